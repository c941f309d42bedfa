#include <algorithm>
#include <cmath>
#include <map>

#include "core/statistics.h"
#include "report/page/format.h"
#include "report/sections.h"
#include "report/svg/svg.h"

namespace mvstudio::report {
namespace {

constexpr size_t kMaxArrows = 500;
constexpr char kCommand[] = "mvstudio calibrate --board … --camera NAME=FILES … --out RUN";

/// Calibration file that a stage wrote: the one beside its result, else the run's first.
const JsonFile* CalibrationOf(const RunData& data, const std::string& folder) {
  for (const JsonFile& file : data.calibrations) {
    if (file.folder == folder) return &file;
  }
  return data.calibrations.empty() ? nullptr : &data.calibrations.front();
}

const Value& CameraByName(const Value& cameras, const std::string& name) {
  static const Value null;
  for (const Value& camera : cameras.items()) {
    if (camera["name"].Text() == name) return camera;
  }
  return null;
}

double FocalOf(const Value& camera) {
  const Value& focal = camera["focal_px"];
  return focal.IsArray() ? focal.At(0).Number() : focal.Number();
}

std::string FocalText(double focal, double sigma) {
  if (!std::isfinite(focal)) return kNoNumber;
  if (!std::isfinite(sigma) || sigma <= 0) return FormatNumber(focal, 6);
  return FormatWithin(focal, sigma) + " \u00b1 " + FormatWithin(sigma, sigma);
}

std::string PercentText(const Value& camera, const std::vector<std::string>& fraction_keys,
                        const std::vector<std::string>& percent_keys) {
  const double fraction = camera.FirstNumber(fraction_keys);
  const double percent = std::isfinite(fraction) ? 100 * fraction : camera.FirstNumber(percent_keys);
  return std::isfinite(percent) ? FormatFixed(percent, 1) : kNoNumber;
}

bool AnyNumber(const Value& cameras, const std::vector<std::string>& keys) {
  return std::any_of(cameras.items().begin(), cameras.items().end(),
                     [&](const Value& c) { return std::isfinite(c.FirstNumber(keys)); });
}

const std::vector<std::string> kShownKeys = {
    "name",           "model",    "num_params",        "focal_px",         "focal_sigma_px", "rms_px",
    "holdout_rms_px", "coverage", "coverage_fraction", "coverage_percent", "rejected",       "rejected_fraction",
    "num_rejected"};

std::string CamerasTable(const Value& cameras, const Value& calibration) {
  const Value known = CalibrationSummary(calibration);
  Table table("Cameras");
  table.AddColumn("camera", "", false);
  table.AddColumn("lens model", "", false);
  table.AddColumn("parameters");
  table.AddColumn("focal length \u00b1 \u03c3", "px");
  table.AddColumn("rms", "px");
  table.AddColumn("held-out rms", "px");
  const bool coverage = AnyNumber(cameras, {"coverage", "coverage_fraction", "coverage_percent"});
  const bool rejected = AnyNumber(cameras, {"rejected_fraction", "rejected", "num_rejected"});
  if (coverage) table.AddColumn("coverage", "%");
  if (rejected) table.AddColumn("rejected");
  std::vector<double> rms;
  for (const Value& camera : cameras.items()) rms.push_back(camera["rms_px"].Number());
  const double typical = LinearQuantile(FiniteValues(rms), 0.5);
  for (const Value& camera : cameras.items()) {
    const Value& file = CameraByName(known, camera["name"].Text());
    const double sigma =
        std::isfinite(camera["focal_sigma_px"].Number()) ? camera["focal_sigma_px"].Number() : file["focal_sigma_px"].Number();
    std::vector<Table::Cell> cells = {
        camera["name"].Text("?"),
        camera["model"].Text(kNoNumber),
        FormatNumber(camera["num_params"].Number()),
        FocalText(std::isfinite(FocalOf(camera)) ? FocalOf(camera) : file["focal_px"].Number(), sigma),
        FormatFixed(camera["rms_px"].Number(), 3),
        FormatFixed(camera["holdout_rms_px"].Number(), 3)};
    if (coverage) cells.emplace_back(PercentText(camera, {"coverage", "coverage_fraction"}, {"coverage_percent"}));
    const double count = camera.FirstNumber({"num_rejected", "rejected"});
    if (rejected) {
      cells.emplace_back(std::isfinite(camera["rejected_fraction"].Number())
                             ? FormatFixed(100 * camera["rejected_fraction"].Number(), 1) + "%"
                             : FormatNumber(count));
    }
    table.AddRow(std::move(cells), camera["rms_px"].Number() > 1.5 * typical);
  }
  return table.Html();
}

std::string RmsChart(const Value& cameras) {
  BarChartSpec spec;
  spec.title = "Reprojection error of each camera";
  spec.value.label = "2-D point RMS (px)";
  BarSeries fitted{"fitted views", {}, {}}, held_out{"held-out views", {}, {}};
  for (const Value& camera : cameras.items()) {
    spec.labels.push_back(camera["name"].Text("?"));
    fitted.values.push_back(camera["rms_px"].Number());
    held_out.values.push_back(camera["holdout_rms_px"].Number());
  }
  spec.series = {fitted};
  if (!FiniteValues(held_out.values).empty()) spec.series.push_back(held_out);
  return spec.labels.empty() ? ""
                             : FigureHtml(BarChart(spec),
                                          "Held-out views took no part in the fit: a held-out error well above the fitted one "
                                          "means too many parameters or too few views.");
}

std::vector<ImageArrow> ReadArrows(const Value& list) {
  std::vector<ImageArrow> arrows;
  const size_t stride = list.items().size() / kMaxArrows + 1;
  for (size_t i = 0; i < list.items().size(); i += stride) {
    const Value& item = list.items()[i];
    arrows.push_back({item.At(0).Number(), item.At(1).Number(), item.At(2).Number(), item.At(3).Number()});
  }
  return arrows;
}

/// camera -> residuals, from an object by camera or from a list of {name, residuals}.
std::vector<std::pair<std::string, const Value*>> ResidualLists(const Value& metrics) {
  std::vector<std::pair<std::string, const Value*>> lists;
  for (const auto& [name, list] : metrics["residuals"].fields()) lists.emplace_back(name, &list);
  for (const Value& item : metrics["residuals"].items()) {
    const Value& list = item["residuals"].IsArray() ? item["residuals"] : item["points"];
    lists.emplace_back(item["name"].Text("?"), &list);
  }
  return lists;
}

std::string ResidualFigures(const Value& metrics, const Value& calibration) {
  std::vector<std::string> figures;
  for (const auto& [name, list] : ResidualLists(metrics)) {
    const std::vector<ImageArrow> arrows = ReadArrows(*list);
    if (arrows.empty()) continue;
    const Value& size = CameraByName(calibration["cameras"], name)["size_px"];
    double width = size.At(0).Number(), height = size.At(1).Number();
    for (const ImageArrow& arrow : arrows) {
      if (size.IsArray()) break;
      width = std::fmax(width, arrow.x);
      height = std::fmax(height, arrow.y);
    }
    figures.push_back(FigureHtml("<div class=\"pair\">" + ResidualField(name + ": residuals", width, height, arrows) +
                                     ResidualCloud("their directions", arrows) + "</div>",
                                 ""));
  }
  return CameraFigures(
      "Residuals",
      "Left: each residual (observed minus projected) drawn from its corner, enlarged; neighbours that point the same way mean "
      "that the lens model does not fit there. Right: the same residuals about zero; dashed, the circle that holds 95 %; the "
      "cross is their mean. A round cloud about zero is what noise alone looks like.",
      figures, figures.size());
}

std::string StageBody(SectionContext* context, const Stage& stage, bool named) {
  const Value& metrics = stage.metrics();
  const JsonFile* file = CalibrationOf(context->data, stage.folder);
  static const Value null;
  const Value& calibration = file ? file->value : null;
  std::string html = named ? StageHeading(context->data, stage) : "";
  std::string summary;
  const auto add = [&](const std::string& label, const std::string& text) {
    summary += (summary.empty() ? "" : "; ") + label + " " + text;
  };
  if (metrics["rms_px"].IsNumber()) add("rms", FormatWithUnit(metrics["rms_px"].Number(), "px", 3));
  if (metrics["holdout_rms_px"].IsNumber()) add("held-out rms", FormatWithUnit(metrics["holdout_rms_px"].Number(), "px", 3));
  if (metrics["baseline_mm"].IsNumber()) add("baseline", FormatWithUnit(metrics["baseline_mm"].Number(), "mm", 5));
  if (metrics["rejected_fraction"].IsNumber())
    add("rejected corners", FormatFixed(100 * metrics["rejected_fraction"].Number(), 1) + "%");
  if (metrics["world"].IsText()) add("world:", metrics["world"].Text());
  if (!summary.empty()) html += ParagraphHtml(summary + ".");
  const Value& cameras = metrics["cameras"];
  const std::string table = cameras.items().empty() ? "" : CamerasTable(cameras, calibration);
  html += GridHtml({table, Covisibility(metrics)}, "pair") + CaptureAdvice(metrics["film_next"]);
  if (!cameras.items().empty()) {
    const std::vector<std::string> all_but_name(kShownKeys.begin() + 1, kShownKeys.end());
    const bool more = !ObjectsTable("", cameras, kShownKeys).empty(), many = cameras.items().size() > 4;
    const std::string folded = (many ? RmsChart(cameras) : "") + (more ? ObjectsTable("", cameras, all_but_name) : "");
    if (!folded.empty()) html += DetailsHtml("More about each camera", folded);
    if (!many) html += RmsChart(cameras);
  }
  html += BoardViews(context, stage);
  html += CalibrationMaps(metrics);
  html += ResidualFigures(metrics, calibration);
  const std::string all = NumbersTable("", metrics);
  if (!all.empty()) html += DetailsHtml("All numbers", all);
  return html;
}

std::string FileTable(const JsonFile& file, const Value& summary) {
  Table table("Calibration file " + file.file);
  table.AddColumn("camera", "", false);
  table.AddColumn("lens model", "", false);
  table.AddColumn("image", "px");
  table.AddColumn("focal length \u00b1 \u03c3", "px");
  table.AddColumn("centre in world x, y, z", "m");
  for (const Value& camera : summary.items()) {
    const Value &size = camera["size_px"], &centre = camera["center_in_world_m"];
    table.AddRow({camera["name"].Text("?"), camera["model"].Text(kNoNumber),
                  FormatNumber(size.At(0).Number()) + " \u00d7 " + FormatNumber(size.At(1).Number()),
                  FocalText(camera["focal_px"].Number(), camera["focal_sigma_px"].Number()),
                  FormatFixed(centre.At(0).Number(), 4) + ", " + FormatFixed(centre.At(1).Number(), 4) + ", " +
                      FormatFixed(centre.At(2).Number(), 4)});
  }
  return table.Html();
}

}  // namespace

Value SkeletonOf(const RunData& data, const CsvFile& points) {
  for (const JsonFile& file : data.poses) {
    if (file.folder == points.folder) return file.value["definition"];
  }
  return {};
}

Section CalibrationSection(SectionContext* context) {
  const RunData& data = context->data;
  Section section{"calibration", "Calibration", ""};
  std::vector<const Stage*> stages = data.All("calibrate");
  for (const Stage* stage : data.All("calib refine")) stages.push_back(stage);
  for (const Stage* stage : stages) section.body_html += StageBody(context, *stage, stages.size() > 1);
  if (stages.empty() && data.calibrations.empty()) {
    SetNotRun(&section, "Calibration", kCommand);
    return section;
  }
  if (data.calibrations.empty()) return section;
  const JsonFile& file = data.calibrations.front();
  const Value summary = CalibrationSummary(file.value);
  const CsvFile* points = data.points.empty() ? nullptr : &data.points.front();
  const std::string rig = RigFigures(file.value, points, points ? SkeletonOf(data, *points) : Value());
  // The viewer, which shows the same in 3D, folds it.
  if (!rig.empty())
    section.body_html += "<details class=\"drawn\" open><summary>The rig, drawn</summary>\n" + rig + "</details>\n";
  section.body_html += stages.empty() ? FileTable(file, summary) : DetailsHtml("Calibration file", FileTable(file, summary));
  if (data.calibrations.size() > 1) {
    std::string others;
    for (size_t i = 1; i < data.calibrations.size(); ++i) others += (i > 1 ? ", " : "") + data.calibrations[i].file;
    section.body_html += ParagraphHtml("Other calibration files in this run, not drawn: " + others + ".", "muted");
  }
  context->json.Set("calibration", Value::Object().Set("file", file.file).Set("cameras", summary));
  return section;
}

}  // namespace mvstudio::report
