#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/statistics.h"
#include "report/page/format.h"
#include "report/sections.h"
#include "report/svg/svg.h"

namespace mvstudio::report {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr char kCommand[] = "mvstudio triangulate --calib RUN/calibration.json --pose2d CAM=FOLDER … --out RUN/pose3d";

struct JointStats {
  std::string joint;
  double rows = 0, ok = 0, median_rms_px = kNone, median_sigma_mm = kNone;
};

/// What a points.csv says of each joint (in the order of the file) and of each status.
struct PointsStats {
  std::vector<JointStats> joints;
  std::vector<std::pair<std::string, double>> statuses;
  std::vector<double> rms_px;
};

PointsStats Summarise(const TableFile& table) {
  PointsStats stats;
  const int joint = table.Column("joint"), status = table.Column("status"), rms = table.Column("rms_px"),
            sigma = table.Column("sigma_m");
  if (joint < 0) return stats;
  std::map<std::string, size_t> index;
  std::vector<std::vector<double>> joint_rms, joint_sigma;
  for (size_t row = 0; row < table.rows.size(); ++row) {
    const std::string& name = table.rows[row][joint];
    const auto [place, is_new] = index.emplace(name, stats.joints.size());
    if (is_new) {
      stats.joints.push_back({name, 0, 0, kNone, kNone});
      joint_rms.emplace_back();
      joint_sigma.emplace_back();
    }
    const std::string state = status < 0 ? "Ok" : table.rows[row][status];
    const auto found =
        std::find_if(stats.statuses.begin(), stats.statuses.end(), [&](const auto& s) { return s.first == state; });
    if (found == stats.statuses.end()) {
      stats.statuses.emplace_back(state, 1);
    } else {
      ++found->second;
    }
    JointStats& of_joint = stats.joints[place->second];
    ++of_joint.rows;
    if (state != "Ok") continue;
    ++of_joint.ok;
    joint_rms[place->second].push_back(table.Number(row, rms));
    joint_sigma[place->second].push_back(1e3 * table.Number(row, sigma));
    stats.rms_px.push_back(table.Number(row, rms));
  }
  for (size_t i = 0; i < stats.joints.size(); ++i) {
    stats.joints[i].median_rms_px = LinearQuantile(FiniteValues(joint_rms[i]), 0.5);
    stats.joints[i].median_sigma_mm = LinearQuantile(FiniteValues(joint_sigma[i]), 0.5);
  }
  return stats;
}

std::string StatusBar(const std::vector<std::pair<std::string, double>>& counts) {
  static const std::map<std::string, int> kColours = {{"Ok", 2},           {"TooFewViews", 6},  {"LowParallax", 4},
                                                      {"Outlier", 1},      {"NotConverged", 7}, {"Degenerate", 3},
                                                      {"BehindCamera", 5}, {"FarPoint", 0}};
  std::vector<StackPart> parts;
  int other = 3;
  for (const auto& [name, count] : counts) {
    const auto colour = kColours.find(name);
    parts.push_back({name, count, colour != kColours.end() ? colour->second : other++});
  }
  std::stable_sort(parts.begin(), parts.end(),
                   [](const StackPart& a, const StackPart& b) { return (a.name == "Ok") > (b.name == "Ok"); });
  if (parts.size() == 1 && parts.front().name == "Ok") return ParagraphHtml("Every joint has a position.");
  return parts.empty() ? ""
                       : FigureHtml(StackedBar("Joints by status", parts),
                                    "Only joints with status Ok have a position; every other one says why it has none.");
}

std::string JointChart(const std::string& title, const std::string& label, const std::vector<JointStats>& joints,
                       double JointStats::*value) {
  BarChartSpec spec;
  spec.title = title;
  spec.value.label = label;
  spec.series.emplace_back();
  for (const JointStats& joint : joints) {
    spec.labels.push_back(joint.joint);
    spec.series[0].values.push_back(joint.*value);
  }
  return FigureHtml(BarChart(spec), "");
}

std::string Presence(const TableFile& table, const std::vector<JointStats>& joints) {
  const int frame = table.Column("frame"), joint = table.Column("joint"), status = table.Column("status");
  const std::vector<double> frames = FiniteValues(table.Numbers(frame));
  const double first = LinearQuantile(frames, 0), last = LinearQuantile(frames, 1);
  if (!std::isfinite(first) || last <= first || status < 0) return {};
  const size_t columns = static_cast<size_t>(std::min(240.0, last - first + 1));
  HeatMapSpec spec;
  spec.title = "Joints over time";
  spec.column_label = "frame";
  spec.first_column = first;
  spec.last_column = last;
  std::map<std::string, size_t> index;
  for (const JointStats& stats : joints) {
    index[stats.joint] = spec.row_names.size();
    spec.row_names.push_back(stats.joint);
  }
  std::vector<std::vector<double>> ok(joints.size(), std::vector<double>(columns, 0)), all = ok;
  for (size_t row = 0; row < table.rows.size(); ++row) {
    if (!std::isfinite(frames[row])) continue;
    const size_t r = index[table.rows[row][joint]];
    // Multiplied first: 29 / 100 * 100 is below 29.
    const double column = (frames[row] - first) * static_cast<double>(columns) / (last - first + 1);
    const size_t c = std::min(columns - 1, static_cast<size_t>(column));
    ++all[r][c];
    if (table.rows[row][status] == "Ok") ++ok[r][c];
  }
  for (size_t r = 0; r < joints.size(); ++r) {
    for (size_t c = 0; c < columns; ++c) all[r][c] = all[r][c] > 0 ? ok[r][c] / all[r][c] : kNone;
    spec.rows.push_back(all[r]);
  }
  return FigureHtml(HeatMap(spec),
                    "Blue: found, the darker the larger the share; orange: asked for and not found; empty: never asked for.");
}

/// Cameras whose residuals do not average out: a calibration that is off shows here first.
std::string CameraTargets(const Value& cameras) {
  const bool left_out = cameras.At(0)["mean_left_out_residual_px"].IsArray();
  std::vector<NamedVector> vectors;
  std::vector<double> lengths;
  for (const Value& camera : cameras.items()) {
    const Value& mean = camera[left_out ? "mean_left_out_residual_px" : "mean_residual_px"];
    if (!mean.IsArray()) continue;
    vectors.push_back({camera["name"].Text("?"), mean.At(0).Number(), mean.At(1).Number()});
    lengths.push_back(std::hypot(vectors.back().dx, vectors.back().dy));
  }
  if (vectors.empty()) return {};
  const std::vector<double> finite = FiniteValues(lengths);
  const double longest = LinearQuantile(finite, 1), none = std::numeric_limits<double>::infinity();
  const double suspect = longest > 1 ? std::min(0.999 * longest, std::max(1.0, 1.5 * LinearQuantile(finite, 0.5))) : none;
  std::string caption = left_out
                            ? "Mean residual (observed minus projected), against the joints that the other cameras alone give."
                            : "Mean residual (observed minus projected), against the joints that all cameras give.";
  caption +=
      " Noise averages out to nothing; what is left is a camera that the calibration puts in the wrong place or with the wrong "
      "lens.";
  for (size_t i = 0; i < vectors.size(); ++i) {
    if (lengths[i] == longest && longest > 1)
      caption += " Look at " + vectors[i].name + " first: off by " + FormatWithUnit(longest, "px", 3) + ".";
  }
  return FigureHtml(VectorTargets("Mean residual of each camera", vectors, suspect), caption);
}

/// Errors of each joint against a reference, where the result has them: {joint or name, median_mm}.
std::string ReferenceChart(const Value& reference) {
  BarChartSpec spec;
  spec.title = "Error of each joint against the reference";
  spec.value.label = "median distance (mm)";
  spec.series.emplace_back();
  for (const char* key : {"joints", "per_joint"}) {
    for (const Value& joint : reference[key].items()) {
      spec.labels.push_back(joint["joint"].Text(joint["name"].Text("?")));
      spec.series[0].values.push_back(joint.FirstNumber({"median_mm", "error_mm", "mean_mm"}));
    }
    for (const auto& [name, value] : reference[key].fields()) {
      spec.labels.push_back(name);
      spec.series[0].values.push_back(value.IsObject() ? value.FirstNumber({"median_mm", "mean_mm"}) : value.Number());
    }
  }
  return spec.labels.empty() ? "" : FigureHtml(BarChart(spec), "");
}

/// Bars of one number of every entry of a list of objects.
std::string ListChart(const std::string& title, const std::string& label, const Value& list, const char* name,
                      const char* key) {
  BarChartSpec spec;
  spec.title = title;
  spec.value.label = label;
  spec.series.emplace_back();
  for (const Value& entry : list.items()) {
    spec.labels.push_back(entry[name].Text("?"));
    spec.series[0].values.push_back(entry[key].Number());
  }
  return spec.labels.empty() ? "" : FigureHtml(BarChart(spec), "");
}

/// One camera left out and predicted by the others; limbs that should not change their length.
std::string HoldoutText(const Value& metrics) {
  const Value& holdout = metrics["holdout"];
  if (!holdout["median_px"].IsNumber()) return {};
  std::string text = "Each camera in turn was left out and its detections predicted from the others: median error " +
                     FormatWithUnit(holdout["median_px"].Number(), "px", 3);
  if (metrics["limb_std_mm"].IsNumber()) {
    text += "; limb lengths vary by " + FormatWithUnit(metrics["limb_std_mm"].Number(), "mm", 3) + " over the take";
  }
  return ParagraphHtml(text + ".");
}

/// The same in detail, and how the method was chosen.
std::string HoldoutTables(const Value& metrics) {
  const Value& holdout = metrics["holdout"];
  std::string html;
  if (holdout["median_px"].IsNumber()) {
    html += DetailsHtml(
        "Left-out error of each camera and joint",
        GridHtml({ListChart("Cameras, each left out", "median error (px)", holdout["cameras"], "name", "median_px"),
                  ListChart("Joints, one camera left out", "median error (px)", holdout["joints"], "joint", "median_px")}));
  }
  html += FoldedTable("Methods compared", metrics["methods"]);
  html += FoldedTable("Terms that bind joints together, tried", metrics["refinement"]["trials"]);
  return html + FoldedTable("Limb lengths", metrics["limbs"]);
}

std::string TableBody(SectionContext* context, const CsvFile& points, bool with_statuses) {
  const PointsStats stats = Summarise(points.table);
  if (stats.joints.empty()) return {};
  std::string html;
  if (with_statuses) html += StatusBar(stats.statuses);
  html += DetailsHtml(
      "Errors of joints",
      GridHtml({FigureHtml(
                    Histogram("Reprojection error of all joints", {"RMS over the views (px)", false, false}, stats.rms_px), ""),
                JointChart("Reprojection error of each joint", "median RMS (px)", stats.joints, &JointStats::median_rms_px),
                JointChart("Predicted uncertainty of each joint", "median \u03c3 (mm)", stats.joints,
                           &JointStats::median_sigma_mm)}));
  if (!std::all_of(stats.joints.begin(), stats.joints.end(), [](const JointStats& j) { return j.ok == j.rows; }))
    html += Presence(points.table, stats.joints);
  Value joints = Value::Array(), statuses = Value::Object();
  for (const JointStats& joint : stats.joints) {
    joints.Append(Value::Object()
                      .Set("joint", joint.joint)
                      .Set("rows", static_cast<int64_t>(joint.rows))
                      .Set("ok", static_cast<int64_t>(joint.ok))
                      .Set("median_rms_px", joint.median_rms_px)
                      .Set("median_sigma_mm", joint.median_sigma_mm));
  }
  for (const auto& [name, count] : stats.statuses) statuses.Set(name, static_cast<int64_t>(count));
  Value list = context->json["triangulation"];
  context->json.Set("triangulation",
                    list.Append(Value::Object().Set("file", points.file).Set("status_counts", statuses).Set("joints", joints)));
  return html;
}

std::string StageBody(SectionContext* context, const Stage& stage, const CsvFile* points, bool named) {
  const Value& metrics = stage.metrics();
  std::string html = named ? StageHeading(context->data, stage) : "";
  std::string summary = FormatCount(metrics["num_points"].Number()) + " joints";
  if (metrics["median_rms_px"].IsNumber()) {
    summary += "; reprojection RMS median " + FormatWithUnit(metrics["median_rms_px"].Number(), "px", 3) + ", mean " +
               FormatWithUnit(metrics["mean_rms_px"].Number(), "px", 3);
  }
  if (metrics["points_per_s"].IsNumber()) summary += "; " + FormatCount(metrics["points_per_s"].Number()) + " joints a second";
  std::vector<std::pair<std::string, double>> counts;
  for (const auto& [name, count] : metrics["status_counts"].fields()) counts.emplace_back(name, count.Number());
  const bool all_found = counts.size() == 1 && counts.front().first == "Ok";
  html += ParagraphHtml(summary + (all_found ? ". Every joint has a position." : "."));
  html += (all_found ? "" : StatusBar(counts)) + HoldoutText(metrics) + CameraTargets(metrics["cameras"]) +
          TakeOverlays(context, stage);
  html += FoldedTable("Numbers of each camera", metrics["cameras"]) + HoldoutTables(metrics);
  for (const char* key : {"truth", "reference", "trc"}) {
    html += NumbersTable(std::string("Against the ") + (std::string(key) == "trc" ? "reference .trc" : key), metrics[key]);
    html += ReferenceChart(metrics[key]);
  }
  if (points) {
    html += TableBody(context, *points, counts.empty());
  } else {
    html += ObjectsTable("Joints", metrics["joints"]);
  }
  const std::string all = NumbersTable("", metrics);
  if (!all.empty()) html += DetailsHtml("All numbers", all);
  return html;
}

}  // namespace

Section TriangulationSection(SectionContext* context) {
  const RunData& data = context->data;
  Section section{"triangulation", "Triangulation", ""};
  const std::vector<const Stage*> stages = data.All("triangulate");
  const bool several = stages.size() + data.points.size() > 2 || stages.size() > 1;
  std::vector<const CsvFile*> left;
  for (const CsvFile& points : data.points) left.push_back(&points);
  for (const Stage* stage : stages) {
    const auto own = std::find_if(left.begin(), left.end(), [&](const CsvFile* p) { return p->folder == stage->folder; });
    section.body_html += StageBody(context, *stage, own == left.end() ? nullptr : *own, several);
    if (own != left.end()) left.erase(own);
  }
  for (const CsvFile* points : left) {
    section.body_html += "<h3>" + EscapeHtml(points->file) + "</h3>\n" + TableBody(context, *points, true);
  }
  if (section.body_html.empty()) SetNotRun(&section, "Triangulation", kCommand);
  return section;
}

}  // namespace mvstudio::report
