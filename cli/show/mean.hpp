#pragma once

#include <report/table.hpp>

#include <cli/commands/mean_analysis.hpp>

#include <string>

namespace liestat::cli {

/// The result for the terminal.
std::string formatMean(const std::string& source, const Measurements& measurements, const MeanAnalysis& analysis);

/// A feature on one line, for lists of rivals and of halves.
std::string oneLine(const FeatureValue& value);

/// Rows of a table with the columns name, x, y, z, unit: each part of the feature with the digits that its standard
/// deviation leaves, and below it standard deviations and dispersion, for translations along both kinds of axes.
TableRows meanRows(const Measurements& measurements, const MeanAnalysis& analysis);

/// The data and what the reader changed in them: "50 rotations …".
std::string measurementsInWords(const std::string& source, const Measurements& measurements);

/// The page: tables, both charts of the rotations or directions (Pennec 1998, fig. 2), the points or translations.
void writeMeanReport(const std::string& directory, const std::string& command_line, const std::string& source,
                     const Measurements& measurements, const MeanAnalysis& analysis);

}  // namespace liestat::cli
