#include "library.hpp"

int main() {
  const std::function<double(double)> square = [](double x) { return x * x; };
  const two_compilers::Result nine = two_compilers::result(square, 3.0);
  const two_compilers::Result eighteen = two_compilers::doubled(nine, EIGEN_MAX_ALIGN_BYTES);
  return eighteen.vector.sum() == 72 && eighteen.list.back() == nine.vector && nine.matrix->trace() == 3 ? 0 : 1;
}
