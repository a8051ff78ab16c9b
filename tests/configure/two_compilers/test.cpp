#include "library.hpp"

int main() {
  const std::function<double(double)> square = [](double x) { return x * x; };
  const Result nine = result(3.0, square);
  const Result eighteen = doubled(nine, EIGEN_MAX_ALIGN_BYTES);
  return eighteen.vector.sum() == 72 && eighteen.list.back() == nine.vector && nine.matrix->trace() == 3 ? 0 : 1;
}
