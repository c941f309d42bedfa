#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/join.h"
#include "report/compare/compared.h"
#include "report/page/format.h"

/// The tables of a comparison.
namespace mvstudio::report {
namespace {

Table::Cell ChangeCell(const ComparedFigure& figure) {
  static constexpr const char* kClasses[] = {"fail", "pass", "warn", "idle", "idle", "idle", "idle"};
  static constexpr const char* kSigns[] = {"\u2717", "\u2713", "\u2260", "\u2248", "=", "\u00b7", "\u00b7"};
  const int i = static_cast<int>(figure.change);
  const std::string word(ToString(figure.change));
  Table::Cell cell(word);
  cell.html = std::string("<span class=\"badge ") + kClasses[i] + "\"><span aria-hidden=\"true\">" + kSigns[i] + "</span> " +
              word + "</span>";
  return cell;
}

std::string SpreadText(const ComparedFigure& figure) {
  if (std::isfinite(figure.half_width)) return "\u00b1" + FormatNumber(figure.half_width, 2);
  const bool counts = figure.change == Change::kOnlyOne || figure.change == Change::kNotCompared;
  return counts ? kNoNumber : "not known";
}

std::string ChangeText(const ComparedFigure& figure) {
  const bool told = figure.change != Change::kNotCompared && std::isfinite(figure.difference());
  return told ? SignedText(figure.difference()) : kNoNumber;
}

std::string DirectionText(Better better) {
  return better == Better::kLess ? "less is better" : better == Better::kMore ? "more is better" : "";
}

/// A row for each figure; runs have columns of their own.
std::string FigureTable(const std::string& caption, const ComparedRuns& runs,
                        const std::vector<const ComparedFigure*>& figures) {
  if (figures.empty()) return {};
  Table table(caption);
  table.AddColumn("verdict", "", false);
  table.AddColumn("command", "", false);
  table.AddColumn("figure", "", false);
  for (const std::string& name : runs.names) table.AddColumn(name);
  table.AddColumn("change");
  table.AddColumn("spread", "95\u00a0%");
  table.AddColumn("direction", "", false);
  for (const ComparedFigure* figure : figures) {
    const std::string folder = figure->stage->folder.empty() ? "" : " (" + figure->stage->folder + ")";
    std::vector<Table::Cell> cells = {ChangeCell(*figure), figure->stage->command + folder, figure->Name()};
    for (const double value : figure->values) cells.emplace_back(FigureText(*figure->figure, value));
    cells.emplace_back(ChangeText(*figure), figure->change == Change::kBetter || figure->change == Change::kWorse);
    cells.emplace_back(SpreadText(*figure));
    cells.emplace_back(DirectionText(figure->figure->better));
    table.AddRow(std::move(cells));
  }
  return table.Html();
}

using Pointers = std::vector<const ComparedFigure*>;

/// Worse ones first, then in the order of the stages.
Pointers Ordered(const std::vector<ComparedFigure>& figures, bool of_cameras) {
  Pointers ordered;
  for (const ComparedFigure& figure : figures) {
    if (of_cameras == !figure.entry.empty()) ordered.push_back(&figure);
  }
  std::stable_sort(ordered.begin(), ordered.end(), [](const auto* a, const auto* b) { return a->change < b->change; });
  return ordered;
}

/// "Worse 1, better 4, within the spread 2."
std::string CountsText(const Pointers& figures) {
  std::map<Change, int> counts;
  for (const ComparedFigure* figure : figures) ++counts[figure->change];
  std::string text = Join(
      counts, ", ", [](const auto& count) { return std::string(ToString(count.first)) + " " + std::to_string(count.second); });
  if (!text.empty()) text[0] = static_cast<char>(std::toupper(text[0]));
  return text + ".";
}

/// Each reason once, with the figures that it keeps apart.
std::string WhyNotCompared(const Pointers& figures, bool for_client) {
  std::map<std::string, std::vector<std::string>> labels;
  for (const ComparedFigure* figure : figures) {
    if (figure->change == Change::kNotCompared) labels[figure->stage->why_not].push_back(figure->Name());
  }
  std::string html;
  const std::string advice = for_client ? "" : " Run `mvstudio avatar eval` with the same options on both.";
  for (const auto& [reason, names] : labels)
    html += ParagraphHtml("Not compared, because scores of different images say nothing of two avatars: " + Join(names, ", ") +
                          ". Here " + reason + "." + advice);
  return html;
}

std::string DifferingTable(const std::string& caption, const std::string& what, const ComparedRuns& runs,
                           const std::vector<DifferingText>& rows) {
  if (rows.empty()) return {};
  Table table(caption);
  table.AddColumn("command", "", false);
  table.AddColumn(what, "", false);
  for (const std::string& name : runs.names) table.AddColumn(name, "", false);
  for (const DifferingText& row : rows) {
    std::vector<Table::Cell> cells = {row.command, row.what};
    for (const std::string& text : row.texts) cells.emplace_back(text);
    table.AddRow(std::move(cells));
  }
  return table.Html();
}

std::set<std::string> WarningsOf(const Stage& stage) {
  std::set<std::string> codes;
  for (const char* list : {"errors", "warnings"}) {
    for (const Value& notice : stage.result[list].items())
      codes.insert(notice["code"].Text(notice["text"].Text(notice.Text())));
  }
  return codes;
}

/// What the first set lacks.
std::string Added(const std::set<std::string>& before, const std::set<std::string>& after) {
  std::vector<std::string> added;
  std::set_difference(after.begin(), after.end(), before.begin(), before.end(), std::back_inserter(added));
  return Join(added, ", ");
}

}  // namespace

Section FiguresSection(const ComparedRuns& runs, const std::vector<ComparedFigure>& figures, bool for_client) {
  const Pointers ordered = Ordered(figures, false);
  const auto is_changed = [](const ComparedFigure* figure) { return figure->change < Change::kEqual; };
  const auto equal = std::partition_point(ordered.begin(), ordered.end(), is_changed);
  Section section{"figures", "Better or worse", FigureTable("", runs, {ordered.begin(), equal})};
  if (ordered.empty()) return section;
  if (equal != ordered.end())
    section.body_html += DetailsHtml(std::to_string(ordered.end() - equal) + " figures that are equal, or not compared",
                                     FigureTable("", runs, {equal, ordered.end()}));
  section.body_html =
      ParagraphHtml(CountsText(ordered)) + section.body_html + FiguresOverRuns(runs, figures) +
      WhyNotCompared(ordered, for_client) +
      ParagraphHtml(
          "The change is that of " + runs.names.back() + " against " + runs.names.front() +
              ". The spread is what both state of their numbers, together: within it a change may be chance. Intervals of "
              "scores are over blocks of held-out frames; what another seed changes is not in them. Where it is not known, "
              "changes in the fourth digit count as equal.",
          "muted");
  return section;
}

Section CamerasSection(const ComparedRuns& runs, const std::vector<ComparedFigure>& figures) {
  const Pointers ordered = Ordered(figures, true);
  Section section{"cameras", "Each camera", ""};
  Pointers changed, others;
  for (const ComparedFigure* figure : ordered) {
    const bool told = figure->change == Change::kWorse || figure->change == Change::kDiffers;
    (told && changed.size() < 8 ? changed : others).push_back(figure);
  }
  if (ordered.empty()) return section;
  section.body_html = ParagraphHtml(CountsText(ordered)) + FigureTable("", runs, changed);
  if (!others.empty())
    section.body_html += DetailsHtml(std::to_string(others.size()) + " more figures", FigureTable("", runs, others));
  return section;
}

Section VerdictsSection(const ComparedRuns& runs, const std::vector<ComparedStage>& stages) {
  Table table("");
  table.AddColumn("command", "", false);
  for (const std::string& name : runs.names) table.AddColumn(name, "", false);
  table.AddColumn("new warnings", "", false);
  table.AddColumn("gone", "", false);
  for (const ComparedStage& stage : stages) {
    std::vector<Table::Cell> cells = {stage.command + (stage.folder.empty() ? "" : " (" + stage.folder + ")")};
    for (const Stage* run : stage.runs) {
      cells.emplace_back("");
      cells.back().html = BadgeHtml(run ? run->verdict : Verdict::kNotRun);
    }
    const auto first = stage.runs.front() ? WarningsOf(*stage.runs.front()) : std::set<std::string>();
    const auto last = stage.runs.back() ? WarningsOf(*stage.runs.back()) : std::set<std::string>();
    cells.emplace_back(stage.InBoth() ? Added(first, last) : "");
    cells.emplace_back(stage.InBoth() ? Added(last, first) : "");
    table.AddRow(std::move(cells));
  }
  return {"verdicts", "Verdicts and warnings", table.empty() ? "" : table.Html()};
}

Section DifferencesSection(const ComparedRuns& runs, const std::vector<DifferingText>& settings,
                           const InputComparison& inputs) {
  Section section{"differences", "Settings and inputs", ""};
  section.body_html = settings.empty() ? ParagraphHtml("No setting differs that the results state.")
                                       : DifferingTable("Settings that differ", "setting", runs, settings);
  if (!inputs.same.empty())
    section.body_html += ParagraphHtml("The same input, byte for byte: " + Join(inputs.same, ", ") + ".");
  if (!inputs.other.empty())
    section.body_html += ParagraphHtml("No input in common: " + Join(inputs.other, ", ") +
                                       ". These runs are of other recordings or other results; a change may come from there.");
  const std::string rows = DifferingTable("", "input", runs, inputs.differing);
  if (!rows.empty()) section.body_html += DetailsHtml("Inputs that differ", rows);
  return section;
}

Section CostsSection(const ComparedRuns& runs, const std::vector<ComparedStage>& stages) {
  Table table("");
  table.AddColumn("command", "", false);
  for (const std::string& name : runs.names) {
    table.AddColumn(name);
    table.AddColumn("memory", "MB");
  }
  for (const ComparedStage& stage : stages) {
    std::vector<Table::Cell> cells = {stage.command + (stage.folder.empty() ? "" : " (" + stage.folder + ")")};
    for (const Stage* run : stage.runs) {
      cells.emplace_back(FormatDuration(run ? run->result.Path("timing.wall_s").Number() : std::nan("")));
      cells.emplace_back(FormatNumber(run ? run->result.Path("timing.peak_rss_mb").Number() : std::nan(""), 3));
    }
    table.AddRow(std::move(cells));
  }
  const std::string note = ParagraphHtml("They belong to the machine, too, and do not count for the verdict.", "muted");
  return {"costs", "Time and memory", table.empty() ? "" : DetailsHtml("Of each command", table.Html() + note)};
}

}  // namespace mvstudio::report
