#include "report/compare/comparison.h"

#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "core/check.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/join.h"
#include "report/compare/compared.h"
#include "report/page/format.h"

namespace mvstudio::report {
namespace {

namespace fs = std::filesystem;

/// The last `count` parts of a folder's path.
std::string EndOfPath(const std::string& folder, int count) {
  const fs::path path = fs::absolute(PathOnDisk(folder)).lexically_normal();
  fs::path end;
  for (auto part = path.end(); part != path.begin() && count > 0;) {
    --part;
    if (part->empty()) continue;
    end = end.empty() ? *part : *part / end;
    --count;
  }
  return end.string();
}

/// The shortest ends of their paths that tell all folders apart.
std::vector<std::string> NamesOf(const std::vector<std::string>& folders, bool client) {
  std::vector<std::string> names;
  if (client) {
    for (size_t i = 0; i < folders.size(); ++i) names.push_back("run " + std::to_string(i + 1));
    return names;
  }
  for (int parts = 1; parts <= 8; ++parts) {
    names.clear();
    for (const std::string& folder : folders) names.push_back(EndOfPath(folder, parts));
    if (std::set<std::string>(names.begin(), names.end()).size() == names.size()) break;
  }
  return names;
}

void RequireComparable(const std::vector<std::string>& folders, const ReportOptions& options) {
  MVS_CHECK(folders.size() >= 2, "a comparison is of two runs or more");
  if (!options.with.empty())
    throw UsageError("option 'with' belongs to the report of one run; name all runs that are compared");
  if (!ForClient(options) && options.audience != "studio")
    throw UsageError("option 'for' " + options.audience + ": give studio or client");
  std::map<fs::path, std::string> places;
  for (const std::string& folder : folders) {
    const auto [at, is_new] = places.emplace(fs::weakly_canonical(folder), folder);
    if (!is_new) throw UsageError(folder + " is given twice: give another run to compare it with");
  }
}

ComparedRuns ReadRuns(const std::vector<std::string>& folders, const ReportOptions& options) {
  ComparedRuns runs;
  for (const std::string& folder : folders) runs.data.push_back(ScanRun(folder, options.follow_links));
  runs.names = NamesOf(folders, ForClient(options));
  return runs;
}

Value TextsToValue(const std::vector<DifferingText>& rows) {
  Value list = Value::Array();
  for (const DifferingText& row : rows) {
    Value texts = Value::Array();
    for (const std::string& text : row.texts) texts.Append(text);
    list.Append(Value::Object().Set("command", row.command).Set("what", row.what).Set("runs", texts));
  }
  return list;
}

const char* WordOfDirection(Better better) {
  return better == Better::kLess ? "less" : better == Better::kMore ? "more" : "neither";
}

Value FiguresToValue(const std::vector<ComparedFigure>& figures) {
  Value list = Value::Array();
  for (const ComparedFigure& figure : figures) {
    Value values = Value::Array();
    for (const double value : figure.values) values.Append(value);
    const bool compared = figure.change != Change::kNotCompared;
    Value entry = Value::Object();
    entry.Set("command", figure.stage->command).Set("folder", figure.stage->folder).Set("camera", figure.entry);
    entry.Set("figure", figure.figure->label).Set("unit", figure.figure->unit);
    entry.Set("better", WordOfDirection(figure.figure->better)).Set("runs", values);
    entry.Set("change", compared ? Value(figure.difference()) : Value()).Set("spread", figure.half_width);
    entry.Set("verdict", std::string(ToString(figure.change)));
    if (!compared) entry.Set("reason", figure.stage->why_not);
    list.Append(std::move(entry));
  }
  return list;
}

Value NamesToValue(const std::vector<std::string>& names) {
  Value list = Value::Array();
  for (const std::string& name : names) list.Append(name);
  return list;
}

/// All that the page and its numbers are made of.
struct Compared {
  ComparedRuns runs;
  std::vector<ComparedStage> stages;
  std::vector<ComparedFigure> figures;
  std::vector<DifferingText> settings;
  InputComparison inputs;
  std::vector<std::string> sentences;
};

std::vector<Section> SectionsOf(SectionContext* context, const Compared& all) {
  std::vector<Section> sections = {FiguresSection(all.runs, all.figures, ForClient(context->options)),
                                   {"heldout", "Held-out images", ImagePairs(context, all.runs, all.stages)},
                                   CamerasSection(all.runs, all.figures)};
  if (!ForClient(context->options)) {
    sections.push_back(VerdictsSection(all.runs, all.stages));
    sections.push_back(DifferencesSection(all.runs, all.settings, all.inputs));
    sections.push_back(CostsSection(all.runs, all.stages));
  }
  std::vector<Section> shown;
  for (Section& section : sections) {
    if (!section.body_html.empty()) shown.push_back(std::move(section));
  }
  return shown;
}

std::string HeaderOf(const std::string& title, const Compared& all, const ReportOptions& options) {
  std::string html = "<h1>" + EscapeHtml(title) + "</h1>" + ParagraphHtml(all.sentences.front(), "sentence");
  for (size_t i = 1; i < all.sentences.size(); ++i) html += ParagraphHtml(all.sentences[i]);
  std::string line = "Runs: " + Join(all.runs.names, ", ");
  if (!ForClient(options)) line = "Runs: " + Join(all.runs.data, ", ", [](const RunData& run) { return run.root; });
  if (!options.generated_at.empty()) line += "; written " + options.generated_at;
  return html + ParagraphHtml(line, "muted");
}

std::string NumbersOf(const std::string& title, const Compared& all, const ReportOptions& options) {
  Value json = Value::Object();
  json.Set("schema", "mvstudio.comparison/1").Set("title", title).Set("sentence", all.sentences.front());
  json.Set("sentences", NamesToValue(all.sentences)).Set("runs", NamesToValue(all.runs.names));
  json.Set("generated_at", options.generated_at).Set("version", options.version).Set("figures", FiguresToValue(all.figures));
  if (ForClient(options)) return json.Dump(1) + "\n";
  Value folders = Value::Array();
  for (const RunData& run : all.runs.data) folders.Append(run.root);
  json.Set("folders", folders).Set("settings", TextsToValue(all.settings)).Set("inputs", TextsToValue(all.inputs.differing));
  json.Set("same_inputs", NamesToValue(all.inputs.same)).Set("no_inputs_in_common", NamesToValue(all.inputs.other));
  return json.Dump(1) + "\n";
}

Compared Compare(const std::vector<std::string>& folders, const ReportOptions& options) {
  Compared all;
  all.runs = ReadRuns(folders, options);
  all.stages = MatchStages(all.runs);
  for (ComparedStage& stage : all.stages) {
    if (ForClient(options)) stage.folder.clear();
  }
  all.figures = CompareFigures(all.stages);
  all.settings = DifferingSettings(all.stages);
  all.inputs = CompareInputs(all.runs, all.stages);
  all.sentences = JudgingSentences(all.runs, all.stages, all.figures);
  return all;
}

}  // namespace

Report BuildComparison(const std::vector<std::string>& folders, const ReportOptions& options) {
  RequireComparable(folders, options);
  const Compared all = Compare(folders, options);
  const RunData& last = all.runs.data.back();
  SectionContext context{last, options, Value::Object(), {}, 0, {}, {}};
  const std::vector<Section> sections = SectionsOf(&context, all);
  const std::string title =
      options.title.empty() ? "Comparison: " + all.runs.names.front() + " and " + all.runs.names.back() : options.title;
  Report report;
  report.sentence = all.sentences.front();
  report.num_stages = static_cast<int>(all.stages.size());
  for (const RunData& run : all.runs.data) {
    report.verdict = Worse(report.verdict, OverallVerdict(run));
    Append(run.warnings, &report.warnings);
  }
  Append(context.warnings, &report.warnings);
  report.html =
      PageHtml(title, HeaderOf(title, all, options), sections,
               "mvstudio" + (options.version.empty() ? "" : " " + options.version) +
                   ". Every number is in the reports of the runs. The same comparison is in the .json beside this file.",
               context.script);
  report.json = NumbersOf(title, all, options);
  return report;
}

}  // namespace mvstudio::report
