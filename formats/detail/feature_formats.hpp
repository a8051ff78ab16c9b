// File formats of features. They differ in how the rows are laid out; everything else is read by formats/features.cpp.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <formats/features.hpp>
#include <formats/text.hpp>

namespace liestat::detail {

/// The layout of a file's rows.
struct RowLayout {
  std::vector<std::string> columns;  ///< in the order of the file; those without a name are passed over
  Separator separator = Separator::comma;
  std::string description;                   ///< the number of columns in words, for messages
  double time_unit = 1;                      ///< s
  bool has_header = false;                   ///< the first line with content is no row
  std::vector<std::size_t> covariance = {};  ///< columns cov_00, cov_01 … cov_55 that `without_covariances` passes over
};

/// The first line with content, as a format is recognised by it.
struct FirstLine {
  std::string_view comment;               ///< the comment before it
  std::vector<std::string_view> words;    ///< its fields, parted by blanks, if there is no comma
  std::vector<std::string_view> commas;   ///< its fields, parted by commas
  std::vector<std::string_view> numbers;  ///< its fields, parted by blanks, if there are several and all are numbers
};

/// A format of files of features.
struct FeatureFormat {
  std::string_view name;
  std::string_view without_header;  ///< the meaning of a line of numbers, if the format has no header; for messages
  bool (*recognises)(const FirstLine& first);
  /// Reads how the rows are laid out; the reader stands at the first line with content. Throws InputError.
  RowLayout (*reads)(const LineReader& reader, const std::string& file, const ReadingOptions& options);
  bool names_columns = false;  ///< a header does, under names that may be the user's
};

/// Takes a row: what it is, alone in a FeatureFile, and the fields that it was read from.
using TakeFeature =
    std::function<void(const FeatureFile& row, const RowLayout& layout, const std::vector<std::string_view>& fields)>;

/// Reads features as readFeatures does, but keeps none of them: each goes to a function. What is returned has no rows.
FeatureFile readFeatureRows(std::string_view text, std::string name, const ReadingOptions& options,
                            const TakeFeature& take);

/// True if the wishes of ReadingOptions::columns are all numbers of columns.
bool columnsByNumber(const std::vector<std::string>& wishes);

/// All formats, in the order in which they are tried.
std::span<const FeatureFormat> featureFormats();

/// The format that the options name, or for `auto` the one that recognises the line at which the reader stands (CSV where
/// columns have numbers). Throws InputError where no format does, std::invalid_argument where there is no such name.
const FeatureFormat& featureFormat(const ReadingOptions& options, const LineReader& reader, const std::string& file);

}  // namespace liestat::detail
