// The shell shared by every type with parameters in memory: one CRTP interface over storage that is owned or viewed,
// and the macro that generates the Eigen::Map views. The mathematics lives in stateless structs (detail::So3Math …)
// that see plain parameter vectors only.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <lie/detail/trig.hpp>

#include <type_traits>

namespace liestat::detail {

/// Tag of the constructors that take parameters as they are.
struct RawParams {};

/// Scalar, Plain (the owning type), Storage and Pointer of a type of the library or of a view of it.
template <class Derived>
struct ShellTraits;

/// Access to the parameter vector of a type, owned or mapped.
template <class Derived>
class Shell {
 public:
  using Scalar = typename ShellTraits<Derived>::Scalar;
  using Plain = typename ShellTraits<Derived>::Plain;
  using Math = typename ShellTraits<Derived>::Math;
  static constexpr int DoF = Math::DoF;
  static constexpr int num_parameters = Math::num_parameters;
  using Params = Eigen::Matrix<Scalar, num_parameters, 1>;
  using Tangent = Eigen::Matrix<Scalar, DoF, 1>;

  /// The parameters in Sophus' memory layout (the header comment of each type states it).
  const auto& params() const { return derived().storage(); }
  /// Pointer to the first parameter.
  const Scalar* data() const { return derived().storage().data(); }
  /// Pointer to the first parameter; to const for views of const memory.
  typename ShellTraits<Derived>::Pointer data() { return derived().mutableStorage().data(); }
  /// The same value in another scalar type.
  template <class NewScalar>
  auto cast() const {
    using New = typename ShellTraits<Derived>::template Rebind<NewScalar>;
    return New::fromParams(params().template cast<NewScalar>().eval());
  }

 protected:
  const Derived& derived() const { return static_cast<const Derived&>(*this); }
  Derived& derived() { return static_cast<Derived&>(*this); }
};

/// A view of T over parameters of Derived: read-only where Derived is a view of const memory.
template <class Derived, class T>
using PartView = Eigen::Map<
    std::conditional_t<std::is_const_v<std::remove_pointer_t<typename ShellTraits<Derived>::Pointer>>, const T, T>>;

/// The translation of a motion, stored behind the parameters of its linear part.
template <class Derived, class Base, int Dim, int offset>
class TranslationAccess : public Base {
  using Vector = Eigen::Matrix<typename Base::Scalar, Dim, 1>;

 public:
  using Base::data;
  /// The translation (m), viewed in place.
  Eigen::Map<const Vector> translation() const { return Eigen::Map<const Vector>(data() + offset); }
  PartView<Derived, Vector> translation() { return PartView<Derived, Vector>(data() + offset); }
};

}  // namespace liestat::detail

namespace liestat {

template <class V>
struct PointTraits;

/// Views of the library's types stand for the type that owns its parameters.
template <class T, int Options, class Stride>
  requires requires { typename detail::ShellTraits<std::remove_const_t<T>>::Plain; }
struct PointTraits<Eigen::Map<T, Options, Stride>> {
  using type = typename detail::ShellTraits<std::remove_const_t<T>>::Plain;
  static type from(const Eigen::Map<T, Options, Stride>& view) { return type(view); }
};

}  // namespace liestat

/// Inside a class template Type<Scalar_, Options_> derived from Base: storage, default construction (the identity or
/// origin), copies and conversions from any view of the same type, and construction from raw parameters.
#define LIESTAT_OWNER(Type, Base)                                                                         \
 public:                                                                                                  \
  using Shell = Base<Type<Scalar_, Options_>>;                                                            \
  using Scalar = Scalar_;                                                                                 \
  using Storage = Eigen::Matrix<Scalar_, Shell::num_parameters, 1, Options_>;                             \
  /** The identity (of a group) or the origin (of a manifold). */                                         \
  Type() : storage_(Shell::Math::identity()) {}                                                           \
  Type(const Type&) = default;                                                                            \
  Type& operator=(const Type&) = default;                                                                 \
  /** Copies the value of any view. */                                                                    \
  template <class Other>                                                                                  \
  Type(const Base<Other>& other) : storage_(other.params()) {} /* NOLINT: implicit as in Eigen */         \
  template <class Other>                                                                                  \
  Type& operator=(const Base<Other>& other) {                                                             \
    storage_ = other.params();                                                                            \
    return *this;                                                                                         \
  }                                                                                                       \
  /** Takes parameters as they are, in the order of params(); the caller vouches for their constraint. */ \
  static Type fromParams(const typename Shell::Params& params) {                                          \
    return Type(::liestat::detail::RawParams{}, params);                                                  \
  }                                                                                                       \
  const Storage& storage() const { return storage_; }                                                     \
  Storage& mutableStorage() { return storage_; }                                                          \
                                                                                                          \
 private:                                                                                                 \
  Type(::liestat::detail::RawParams, const typename Shell::Params& params) : storage_(params) {}          \
  Storage storage_

/// At global scope, after the class template: its traits and the views Eigen::Map<Type<S>> and Eigen::Map<const
/// Type<S>>.
#define LIESTAT_TRAITS(Type, MathTemplate)                                                                           \
  template <class S, int O>                                                                                          \
  struct liestat::detail::ShellTraits<liestat::Type<S, O>> {                                                         \
    using Scalar = S;                                                                                                \
    using Plain = liestat::Type<S>;                                                                                  \
    using Math = MathTemplate<S>;                                                                                    \
    using Pointer = S*;                                                                                              \
    template <class T>                                                                                               \
    using Rebind = liestat::Type<T>;                                                                                 \
  };                                                                                                                 \
  template <class S, int O, int M>                                                                                   \
  struct liestat::detail::ShellTraits<Eigen::Map<liestat::Type<S, O>, M>> : ShellTraits<liestat::Type<S, O>> {};     \
  template <class S, int O, int M>                                                                                   \
  struct liestat::detail::ShellTraits<Eigen::Map<const liestat::Type<S, O>, M>> : ShellTraits<liestat::Type<S, O>> { \
    using Pointer = const S*;                                                                                        \
  };

#define LIESTAT_MAPS(Type, Base)                                                             \
  namespace Eigen {                                                                          \
  /** View of parameters in memory; writes go through. */                                    \
  template <class S, int O, int M>                                                           \
  class Map<liestat::Type<S, O>, M> : public Base<Map<liestat::Type<S, O>, M>> {             \
   public:                                                                                   \
    using Shell = Base<Map<liestat::Type<S, O>, M>>;                                         \
    using Scalar = S;                                                                        \
    using Storage = Map<Matrix<S, Shell::num_parameters, 1>, M>;                             \
    explicit Map(S* data) : storage_(data) {}                                                \
    Map(const Map&) = default;                                                               \
    Map& operator=(const Map& other) {                                                       \
      storage_ = other.storage_;                                                             \
      return *this;                                                                          \
    }                                                                                        \
    template <class Other>                                                                   \
    Map& operator=(const Base<Other>& other) {                                               \
      storage_ = other.params();                                                             \
      return *this;                                                                          \
    }                                                                                        \
    const Storage& storage() const { return storage_; }                                      \
    Storage& mutableStorage() { return storage_; }                                           \
                                                                                             \
   private:                                                                                  \
    Storage storage_;                                                                        \
  };                                                                                         \
  /** Read-only view of parameters in memory. */                                             \
  template <class S, int O, int M>                                                           \
  class Map<const liestat::Type<S, O>, M> : public Base<Map<const liestat::Type<S, O>, M>> { \
   public:                                                                                   \
    using Shell = Base<Map<const liestat::Type<S, O>, M>>;                                   \
    using Scalar = S;                                                                        \
    using Storage = Map<const Matrix<S, Shell::num_parameters, 1>, M>;                       \
    explicit Map(const S* data) : storage_(data) {}                                          \
    const Storage& storage() const { return storage_; }                                      \
    const Storage& mutableStorage() { return storage_; }                                     \
                                                                                             \
   private:                                                                                  \
    Storage storage_;                                                                        \
  };                                                                                         \
  }
