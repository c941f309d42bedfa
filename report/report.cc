#include "report/report.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "core/check.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "report/page/format.h"
#include "report/sections.h"

namespace mvstudio::report {
namespace fs = std::filesystem;
namespace {

std::string TitleOf(const std::string& run_folder, const ReportOptions& options) {
  if (!options.title.empty()) return options.title;
  if (ForClient(options)) return "Capture report";
  return "Capture report: " + fs::path(PathOnDisk(run_folder)).filename().string();
}

/// Files that were never a run's: a calibration of another program, points of a capture system.
bool HoldsFilesAlone(const RunData& data) { return data.stages.empty() && data.histories.empty() && data.provenance.empty(); }

/// Whether cameras saw the points; those of a capture system state none.
bool AreMeasured(const CsvFile& points) {
  const std::vector<double> views = points.table.Numbers(points.table.Column("num_views"));
  return std::any_of(views.begin(), views.end(), [](double count) { return count > 0; });
}

std::string CountText(size_t count, const std::string& what) {
  return FormatCount(static_cast<double>(count)) + " " + what + (count == 1 ? "" : "s");
}

/// "5 cameras; 25 joints over 100 time steps."
std::string SentenceOfFiles(const RunData& data) {
  std::string text;
  if (!data.calibrations.empty()) text = CountText(data.calibrations.front().value["cameras"].items().size(), "camera");
  if (!data.points.empty()) {
    const TableFile& table = data.points.front().table;
    std::set<std::string> joints, frames;
    const int joint = table.Column("joint"), frame = table.Column("frame");
    for (const auto& row : table.rows) {
      if (joint >= 0) joints.insert(row[joint]);
      if (frame >= 0) frames.insert(row[frame]);
    }
    text += (text.empty() ? "" : "; ") + CountText(joints.size(), "joint") + " over " + CountText(frames.size(), "time step");
  }
  return text + ".";
}

std::string Header(const std::string& title, Verdict verdict, const SectionContext& context) {
  const RunData& data = context.data;
  const ReportOptions& options = context.options;
  const bool client = ForClient(options);
  if (HoldsFilesAlone(data))
    return "<h1>" + EscapeHtml(title) + "</h1>" + ParagraphHtml(SentenceOfFiles(data), "sentence") +
           (client ? "" : WorstList(context));
  const std::string& written = options.generated_at;
  const std::string when = written.empty() ? "" : "<span class=\"muted\">written " + EscapeHtml(written) + "</span>";
  return "<h1>" + EscapeHtml(title) + "</h1>" + BadgeHtml(verdict) + when +
         ParagraphHtml(VerdictSentence(data, !client), "sentence") + (client ? "" : WorstList(context));
}

Value NoticesToValue(const std::vector<Notice>& notices) {
  Value list = Value::Array();
  for (const Notice& notice : notices) {
    list.Append(Value::Object().Set("code", notice.code).Set("text", notice.text).Set("hint", notice.hint));
  }
  return list;
}

Value StagesToValue(const RunData& data, bool client) {
  Value list = Value::Array();
  for (const Stage& stage : data.stages) {
    Value entry = Value::Object();
    if (!client) entry.Set("file", stage.file);
    entry.Set("command", stage.command).Set("verdict", std::string(ToString(stage.verdict)));
    if (client) {
      list.Append(std::move(entry));
      continue;
    }
    for (const char* key : {"version", "status", "exit", "metrics", "outputs", "warnings", "errors", "timing", "argv"}) {
      entry.Set(key, stage.result[key]);
    }
    list.Append(std::move(entry));
  }
  return list;
}

/// The scored avatars of another folder; the results keep their place by an absolute folder.
void AddAvatars(const std::string& folder, bool follow_links, RunData* data) {
  RunData other = ScanRun(folder, follow_links);
  const fs::path root = fs::weakly_canonical(folder), own = fs::weakly_canonical(data->root);
  std::set<fs::path> known;
  for (const Stage& stage : data->stages) known.insert(own / stage.file);
  for (Stage& stage : other.stages) {
    if (stage.command != "avatar eval" && stage.command != "avatar train") continue;
    if (known.count(root / stage.file) > 0) continue;
    stage.file = (root / stage.file).string(), stage.folder = (root / stage.folder).string();
    data->stages.push_back(std::move(stage));
  }
  for (Notice& warning : other.warnings) data->warnings.push_back(std::move(warning));
}

std::vector<Section> SectionsOfFiles(SectionContext* context) {
  std::vector<Section> sections = {StudioSection(context)};
  if (!context->data.calibrations.empty()) sections.push_back(CalibrationSection(context));
  if (!context->data.points.empty() && AreMeasured(context->data.points.front()))
    sections.push_back(TriangulationSection(context));
  if (!context->warnings.empty() || !context->data.warnings.empty()) sections.push_back(VerdictSection(context));
  return sections;
}

std::vector<Section> StudioSections(SectionContext* context) {
  if (HoldsFilesAlone(context->data)) return SectionsOfFiles(context);
  std::vector<Section> sections = {PreviewSection(context),     HeldOutSection(context),       FootageSection(context),
                                   CalibrationSection(context), TriangulationSection(context), DatasetSection(context),
                                   AvatarSection(context),      TruthSection(context),         ProvenanceSection(context)};
  sections.insert(sections.begin() + 2, StudioSection(context));
  sections.insert(sections.begin() + 2, VerdictSection(context));
  return sections;
}

std::vector<Section> ClientSections(SectionContext* context) {
  std::vector<Section> sections = {
      PreviewSection(context), HeldOutSection(context), {"verdict", "Verdict", StageCards(context->data, false)}};
  if (!context->data.calibrations.empty()) {
    const CsvFile* points = context->data.points.empty() ? nullptr : &context->data.points.front();
    sections.push_back(StudioSection(context));
    sections.push_back({"rig", "Rig", RigFigures(context->data.calibrations.front().value, points, Value())});
  }
  return sections;
}

}  // namespace

bool ForClient(const ReportOptions& options) { return options.audience == "client"; }

Report BuildReport(const std::string& run_folder, const ReportOptions& options) {
  MVS_CHECK(options.max_heldout_images >= 0 && options.max_image_mb >= 0 && options.max_images_total_mb >= 0,
            "limits of images must not be negative");
  const bool client = ForClient(options);
  if (!client && options.audience != "studio") throw UsageError("option 'for' " + options.audience + ": give studio or client");
  RunData data = ScanRun(run_folder, options.follow_links);
  for (const std::string& folder : options.with) AddAvatars(folder, options.follow_links, &data);
  SectionContext context{data, options, Value::Object(), {}, 0, {}, {}};
  std::vector<Section> sections = client ? ClientSections(&context) : StudioSections(&context);
  // What was not run is told last. A section without a body had nothing to say, not even that.
  std::stable_partition(sections.begin(), sections.end(), [](const Section& section) { return section.has_results; });
  std::vector<Section> shown;
  for (Section& section : sections) {
    if (!section.body_html.empty()) shown.push_back(std::move(section));
  }
  Report report;
  report.verdict = OverallVerdict(data);
  report.num_stages = static_cast<int>(data.stages.size());
  report.sentence = VerdictSentence(data, !client);
  report.warnings = data.warnings;
  report.warnings.insert(report.warnings.end(), context.warnings.begin(), context.warnings.end());
  const std::string title = TitleOf(run_folder, options);
  report.html = PageHtml(
      title, Header(title, report.verdict, context), shown,
      "mvstudio" + (options.version.empty() ? "" : " " + options.version) +
          ". RMS is that of 2-D points, sqrt(mean |r|\u00b2), in px. The same numbers are in the .json beside this file.",
      context.script);
  Value json = Value::Object();
  json.Set("schema", "mvstudio.report/1").Set("title", title).Set("verdict", std::string(ToString(report.verdict)));
  json.Set("sentence", report.sentence);
  json.Set("generated_at", options.generated_at).Set("version", options.version).Set("stages", StagesToValue(data, client));
  for (const auto& [key, value] : context.json.fields()) json.Set(key, value);
  if (!client) json.Set("warnings", NoticesToValue(report.warnings));
  report.json = json.Dump(1) + "\n";
  return report;
}

std::string NumbersPath(const std::string& html_path) {
  const std::string json_path = fs::path(html_path).replace_extension(".json").string();
  if (json_path == html_path)
    throw UsageError("option 'out' " + html_path + ": the page must not end in .json, that name is for its numbers");
  return json_path;
}

std::string WriteReport(const Report& report, const std::string& html_path) {
  const std::string json_path = NumbersPath(html_path);
  FilesTogether files;
  WriteFileAtomic(json_path, report.json);
  WriteFileAtomic(html_path, report.html);
  files.Commit();
  return json_path;
}

}  // namespace mvstudio::report
