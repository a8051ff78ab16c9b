#include "library.hpp"

namespace two_compilers {

template Result result<double>(const std::function<double(double)>&, double);

Result doubled(const Result& result, std::size_t alignment) {
  Result twice = result;
  if (alignment == EIGEN_MAX_ALIGN_BYTES) twice.vector *= 2;
  return twice;
}

}  // namespace two_compilers
