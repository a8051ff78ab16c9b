#include <cli/show/mean.hpp>

namespace liestat::cli {

void setMeanFields(JsonObject& object, const std::string& source, const Measurements& measurements,
                   const MeanAnalysis& analysis) {
  object.set("file", source).set("format", measurements.file.format);
  object.set("n_normalised", measurements.file.n_normalised);
  object.set("largest_norm_error", measurements.file.largest_norm_error);
  object.fieldsOf<MeanSummary>(analysis);
}

}  // namespace liestat::cli
