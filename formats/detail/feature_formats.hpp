// File formats of features. They differ in how the rows are laid out; everything else is read by formats/features.cpp.
#pragma once

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
  std::string description;  ///< the number of columns in words, for messages
  double time_unit = 1;     ///< s
  bool has_header = false;  ///< the first line with content is no row
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

/// All formats, in the order in which they are tried.
std::span<const FeatureFormat> featureFormats();

/// The format of that name, or for `auto` the one that recognises the line at which the reader stands. Throws InputError
/// where no format does, std::invalid_argument where there is no such name.
const FeatureFormat& featureFormat(std::string_view name, const LineReader& reader, const std::string& file);

}  // namespace liestat::detail
