#include <cli/show/validation.hpp>

#include <sstream>

namespace liestat::cli {

using namespace experiments;

namespace {

/// The verdict that is shown; none where nothing was promised.
std::optional<Verdict> shownVerdict(const ValidationView& view) {
  if (view.judgement) return view.judgement->verdict();
  if (trials_of_run.incomplete()) return Verdict::none("INTERRUPTED: " + interruptedSentence());
  return view.verdict;
}

}  // namespace

std::string ValidationView::text() const {
  std::string text = head;
  for (const ValidationTable& part : tables) {
    if (part.table.terminal.rows.empty()) continue;
    if (!part.title.empty()) {
      text += "\n" + part.title + "\n";
    } else if (!text.empty() && !text.ends_with("\n\n")) {
      text += "\n";
    }
    if (!part.caption.empty()) text += part.caption + "\n";
    text += Table(part.table.terminal).str(part.width) + part.below;
  }
  text += legend;
  if (!judgement && !trials_of_run.incomplete()) return text;
  const std::string shown = shownVerdict(*this)->text;
  const std::size_t colon = shown.find(": ");
  return text + "\n" + (judgement ? judgement->failures() : "") + shown.substr(colon + 2) + "\n" +
         shown.substr(0, colon) + "\n";
}

JsonObject ValidationView::json(const std::string& command_line, std::uint64_t seed) const {
  JsonObject object = jsonEnvelope(command_line, seed);
  if (judgement) {
    object.fieldsOf(*judgement);
  } else {
    object.fieldsOf(trials_of_run);
  }
  fields(object);
  return object;
}

void ValidationView::writePage(const std::string& directory, const std::string& command_line) const {
  Report report(directory, title);
  if (const auto shown = shownVerdict(*this)) report.verdict(*shown);
  std::istringstream paragraphs(introduction);
  for (std::string text; std::getline(paragraphs, text);) report.paragraph(text);
  report.code(command_line);
  for (const ValidationTable& part : tables) {
    if (page || part.table.page.rows.empty()) continue;
    const std::string heading = part.page_title.value_or(part.title);
    if (!heading.empty()) report.section(heading);
    for (const Plot& plot : part.above) report.plot(plot);
    report.table(part.table.page, part.page_caption.value_or(part.caption));
    for (const Plot& plot : part.plots) report.plot(plot);
  }
  if (page) page(report);
  report.write();
}

std::string verdictCell(const std::optional<bool>& passed) {
  if (!passed) return "";
  return *passed ? "pass" : "FAIL";
}

Panel histogramPanel(const JudgedReport& row, const std::string& title) {
  Panel panel{title, {.label = "squared Mahalanobis distance", .low = 0.0}, {.label = "density", .low = 0.0}};
  Series boxes{.name = "trials", .style = Style::boxes}, density{.name = row.report.law.name(), .style = Style::lines};
  for (const HistogramBin& bin : row.histogram) {
    for (Series* series : {&boxes, &density}) series->x.push_back(0.5 * (bin.lower + bin.upper));
    boxes.y.push_back(bin.density);
    density.y.push_back(bin.expected);
  }
  panel.series = {boxes, density};
  return panel;
}

}  // namespace liestat::cli
