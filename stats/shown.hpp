// Fields that a result may lack, in its description (report/describe.hpp). Needs nothing.
//
//   if (shown(v, window.nees.has_value())) v("nees", window.nees, "5 expected");
//
// A view of values passes over such a field where the condition fails. A view of types, which lists the fields that a
// result of the type may have, takes all of them, from a default-constructed result: it has a static member `every_field`.
#pragma once

namespace liestat {

/// True if a view takes the fields that a result has where `there` holds: always for views that list a type's fields.
template <class V>
constexpr bool shown(const V&, bool there) {
  return there || requires { V::every_field; };
}

}  // namespace liestat
