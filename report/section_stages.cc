#include <algorithm>
#include <string>
#include <vector>

#include "report/page/format.h"
#include "report/sections.h"

/// Sections that show whatever their commands saved: numbers, tables, findings and images.
namespace mvstudio::report {
namespace {

std::string Findings(const Value& metrics) {
  std::string html;
  for (const char* key : {"findings", "problems", "issues", "errors"}) {
    const Value& list = metrics[key];
    if (list.items().empty()) continue;
    if (list.At(0).IsObject()) {
      html += ObjectsTable("Findings", list);
    } else {
      Table table("Findings");
      table.AddColumn("finding", "", false);
      for (const Value& item : list.items()) table.AddRow({item.Text(item.Dump())});
      html += table.Html();
    }
  }
  return html;
}

std::string Capitalised(std::string text) {
  if (!text.empty()) text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
  return text;
}

/// Folded where it is long.
std::string TableByLength(const std::string& title, const Value& array) {
  constexpr size_t kMostOpen = 4;
  return array.items().size() > kMostOpen ? FoldedTable(title, array) : ObjectsTable(title, array);
}

/// "cam_01", not the path of its file.
std::string OverlayCaption(const Stage& stage, const Value& output) {
  const std::string path = output["path"].Text(), file = path.substr(path.rfind('/') + 1);
  const std::string stem = file.substr(0, file.find('.'));
  std::string camera = output["camera"].Text();
  for (const Value& entry : stage.metrics()["per_camera"].items()) {
    if (camera.empty() && entry["name"].Text() == stem) camera = stem;
  }
  const std::string what = stage.command == "pose2d" ? "Keypoints"
                           : stage.command == "mask" ? "Outlines of the masks"
                                                     : "Overlay";
  return what + (camera.empty() ? ": " + WordsOf(stem) : ", camera " + camera);
}

/// The first four; more are folded, since each is a contact sheet.
std::string OverlaysHtml(const std::vector<std::string>& figures) {
  constexpr size_t kMostOpen = 4;
  const auto end = figures.begin() + static_cast<std::ptrdiff_t>(std::min(figures.size(), kMostOpen));
  const std::vector<std::string> open(figures.begin(), end), folded(end, figures.end());
  if (open.empty()) return {};
  return GridHtml(open, "grid images") +
         (folded.empty() ? ""
                         : DetailsHtml(std::to_string(folded.size()) + (folded.size() == 1 ? " more camera" : " more cameras"),
                                       GridHtml(folded, "grid images")));
}

std::string StageBody(SectionContext* context, const Stage& stage) {
  const Value& metrics = stage.metrics();
  std::vector<std::string> overlays;
  for (const Value& output : stage.result["outputs"].items()) {
    if (output["role"].Text() == "overlay")
      overlays.push_back(EmbedOutput(context, stage, output, OverlayCaption(stage, output)));
  }
  std::string html = StageHeading(context->data, stage) + OverlaysHtml(overlays);
  const std::string findings = Findings(metrics);
  if (findings.empty() && stage.command == "dataset verify" && stage.verdict == Verdict::kPass)
    html += ParagraphHtml("Nothing found.");
  html += findings;
  for (const auto& [key, value] : metrics.fields()) {
    if (value.IsArray() && value.At(0).IsObject() && key != "findings" && key != "problems" && key != "issues" &&
        key != "errors") {
      html += TableByLength(Capitalised(LabelOfKey(key).label), value);
    }
    if (!value.IsObject()) continue;
    for (const auto& [inner_key, inner] : value.fields()) {
      if (inner.IsArray() && inner.At(0).IsObject())
        html += TableByLength(Capitalised(LabelOfKey(key).label + ": " + LabelOfKey(inner_key).label), inner);
    }
  }
  const std::string all = NumbersTable("", metrics);
  return GridHtml({html, all.empty() ? "" : DetailsHtml("All numbers", all)}, "result");
}

using Commands = std::vector<std::string>;

/// "dataset build" belongs to "dataset".
std::string StagesOf(SectionContext* context, const Commands& commands) {
  std::string html;
  for (const Stage& stage : context->data.stages) {
    const std::string first = stage.command.substr(0, stage.command.find(' '));
    const bool shown = std::find(commands.begin(), commands.end(), stage.command) != commands.end() ||
                       std::find(commands.begin(), commands.end(), first) != commands.end();
    if (shown) html += StageBody(context, stage);
  }
  return html;
}

}  // namespace

Section FootageSection(SectionContext* context) {
  return {"footage", "Footage, keypoints and masks", StagesOf(context, {"session", "doctor", "sync", "pose2d", "mask"})};
}

Section DatasetSection(SectionContext* context) {
  Section section{"dataset", "Dataset", StagesOf(context, {"dataset"})};
  if (section.body_html.empty()) {
    SetNotRun(&section, "Dataset",
              "mvstudio dataset build --calib RUN/calibration.json --video CAM=FILE … "
              "--pose3d RUN/pose3d --out RUN/dataset");
  }
  return section;
}

}  // namespace mvstudio::report
