// How an estimate ended. Estimators never throw on data: they return a result that says what happened.
#pragma once

namespace liestat {

/// The state of an estimate. Only `ok` may be used without a further look.
enum class Status {
  ok,             ///< converged
  not_converged,  ///< the iteration ended elsewhere: the budget ran out, or the data are not finite
  ambiguous,      ///< another feature explains the data as well
  contested,      ///< the data do not tell several models apart; the result lists them
  ill_defined,    ///< the criterion has no smooth minimum; a covariance would be wrong and is withheld
  inconsistent,   ///< the measurements refute the noise that is stated for them; a covariance from it is withheld
  too_few,        ///< fewer measurements than the estimate needs
  not_applicable  ///< the question has no answer for these data
};

/// True if an iteration that ended with this status found a minimum, whatever else there is to say about it.
constexpr bool converged(Status status) {
  return status == Status::ok || status == Status::ambiguous || status == Status::contested ||
         status == Status::ill_defined || status == Status::inconsistent;
}

/// The name used in files and messages.
constexpr const char* name(Status status) {
  switch (status) {
    case Status::ok:
      return "ok";
    case Status::not_converged:
      return "not_converged";
    case Status::ambiguous:
      return "ambiguous";
    case Status::contested:
      return "contested";
    case Status::ill_defined:
      return "ill_defined";
    case Status::inconsistent:
      return "inconsistent";
    case Status::too_few:
      return "too_few";
    case Status::not_applicable:
      return "not_applicable";
  }
  return "unknown";
}

}  // namespace liestat
