#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <set>

#include "calib/calibrate.h"
#include "calib/detect_footage.h"
#include "cli/commands.h"
#include "core/error.h"
#include "core/files.h"
#include "core/units.h"
#include "dataset/frames.h"
#include "geometry/rig_io.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct Arguments {
  std::string board, out;
  std::vector<std::string> cameras;
  calib::FootageOptions footage;
  calib::CalibrateOptions calibrate;
};

/// The last number in a file name without its extension, if any.
std::optional<int64_t> TrailingNumber(const std::string& file_name) {
  const std::string stem = std::filesystem::path(file_name).stem().string();
  const auto last = stem.find_last_of("0123456789");
  if (last == std::string::npos) return std::nullopt;
  const auto before = stem.find_last_not_of("0123456789", last);
  const std::string digits = stem.substr(before + 1, last - before);
  if (digits.size() > 18) return std::nullopt;
  return std::stoll(digits);
}

/// Frames of an image camera are numbered by their file names, those of a video by position.
calib::Footage OpenFootage(const std::string& name, const std::string& path) {
  const std::shared_ptr<dataset::FrameSource> source = dataset::OpenFrames(path);
  calib::Footage footage;
  footage.camera = name;
  footage.path = path;
  footage.num_frames = source->num_frames();
  footage.next = [source]() -> std::optional<calib::FootageFrame> {
    auto frame = source->Next();
    if (!frame) return std::nullopt;
    const bool is_file = frame->label.rfind("frame ", 0) != 0;
    const auto number = is_file ? TrailingNumber(frame->label) : std::nullopt;
    return calib::FootageFrame{number.value_or(frame->frame_idx), frame->label, std::move(frame->rgb)};
  };
  return footage;
}

std::vector<calib::Footage> OpenAll(const Arguments& arguments, CommandResult* result) {
  if (arguments.cameras.empty()) throw UsageError("--camera NAME=PATH is needed at least once");
  std::vector<calib::Footage> footage;
  std::set<std::string> names;
  for (const std::string& text : arguments.cameras) {
    const auto [name, path] = SplitNamePath("--camera", text);
    if (!names.insert(name).second) throw UsageError("--camera " + name + " is given twice");
    footage.push_back(OpenFootage(name, path));
    result->inputs.push_back(path);
  }
  return footage;
}

ordered_json Number(double value) { return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr); }

ordered_json CameraMetrics(const calib::CameraReport& camera, const calib::FootageDetections& found) {
  ordered_json json;
  json["name"] = camera.name;
  json["model"] = std::string(geometry::ToString(camera.model));
  json["model_reason"] = camera.model_reason;
  json["num_params"] = camera.num_params;
  json["focal_px"] = Number(camera.focal_px);
  json["focal_sigma_px"] = Number(camera.focal_sigma_px);
  json["rms_px"] = Number(camera.rms_px);
  json["holdout_rms_px"] = Number(camera.holdout_rms_px);
  json["holdout_median_px"] = Number(camera.holdout_median_px);
  json["num_images"] = found.num_images;
  json["num_views"] = camera.num_views;
  json["num_corners"] = camera.num_corners;
  json["num_rejected"] = camera.num_rejected + found.num_corners_dropped;
  json["coverage"] = Number(camera.coverage);
  json["valid_radius"] = Number(camera.valid_radius);
  json["covers_image"] = camera.covers_image;
  json["boards_not_used"] = found.reasons;
  return json;
}

/// At most 2000 kept corners of each camera: [x_px, y_px, dx, dy].
ordered_json ResidualSamples(const calib::CalibrateReport& report) {
  constexpr size_t kMaxPoints = 2000;
  ordered_json json = ordered_json::object();
  for (size_t c = 0; c < report.cameras.size(); ++c) {
    std::vector<const calib::CornerResidual*> kept;
    for (const calib::CornerResidual& r : report.residuals) {
      if (r.camera_idx == static_cast<int>(c) && !r.rejected) kept.push_back(&r);
    }
    const size_t stride = std::max<size_t>(1, (kept.size() + kMaxPoints - 1) / kMaxPoints);
    ordered_json points = ordered_json::array();
    for (size_t i = 0; i < kept.size(); i += stride) {
      const auto rounded = [](double value, double step) { return std::round(value / step) * step; };
      const Eigen::Vector2d observed_minus_projected = -kept[i]->residual_px;
      points.push_back({rounded(kept[i]->px.x(), 1e-3), rounded(kept[i]->px.y(), 1e-3),
                        rounded(observed_minus_projected.x(), 1e-5), rounded(observed_minus_projected.y(), 1e-5)});
    }
    json[report.cameras[c].name] = points;
  }
  return json;
}

ordered_json VerdictJson(const calib::Verdict& verdict) {
  ordered_json json{{"status", verdict.status}, {"reasons", ordered_json::array()}};
  for (const auto& reason : verdict.reasons) json["reasons"].push_back(reason.text);
  return json;
}

double BaselineMm(const geometry::Rig& rig) {
  return 1e3 * (rig.cameras[0].CenterInWorld() - rig.cameras[1].CenterInWorld()).norm();
}

void FillMetrics(const calib::CalibrateReport& report, const std::vector<calib::FootageDetections>& found,
                 ordered_json* metrics) {
  ordered_json& m = *metrics;
  m["rms_px"] = Number(report.rms_px);
  m["sigma_px"] = Number(report.sigma_px);
  m["holdout_rms_px"] = Number(report.holdout_rms_px);
  m["holdout_median_px"] = Number(report.holdout_median_px);
  m["rejected_fraction"] = Number(report.rejected_fraction);
  if (report.rig.cameras.size() == 2) m["baseline_mm"] = Number(BaselineMm(report.rig));
  m["num_frames"] = report.num_frames;
  m["num_corners"] = report.num_corners;
  m["gauge"] = report.gauge;
  m["verdict"] = VerdictJson(report.verdict);
  m["cameras"] = ordered_json::array();
  for (size_t c = 0; c < report.cameras.size(); ++c) m["cameras"].push_back(CameraMetrics(report.cameras[c], found[c]));
  m["residuals"] = ResidualSamples(report);
}

std::string Summary(const calib::CalibrateReport& report, const std::string& path) {
  char line[300];
  std::string text = "camera              model      focal px  +-      rms px  held-out px  boards  coverage\n";
  for (const calib::CameraReport& c : report.cameras) {
    std::snprintf(line, sizeof line, "%-19s %-9s %9.2f  %-6.2f %7.3f  %11.3f  %6d  %6.0f %%\n", c.name.c_str(),
                  std::string(geometry::ToString(c.model)).c_str(), c.focal_px, c.focal_sigma_px, c.rms_px, c.holdout_rms_px,
                  c.num_views, 100 * c.coverage);
    text += line;
  }
  std::snprintf(line, sizeof line, "rig: rms %.3f px, held-out %.3f px, %d corners in %d frames, %.1f %% rejected, world: %s\n",
                report.rms_px, report.holdout_rms_px, report.num_corners, report.num_frames, 100 * report.rejected_fraction,
                report.gauge.c_str());
  text += line;
  if (report.rig.cameras.size() == 2) {
    std::snprintf(line, sizeof line, "baseline %.3f mm\n", BaselineMm(report.rig));
    text += line;
  }
  text += "verdict: " + report.verdict.status + "\n";
  for (const auto& reason : report.verdict.reasons)
    text += "  " + reason.text + (reason.hint.empty() ? "" : ": " + reason.hint) + "\n";
  return text + "wrote " + path + "\n";
}

CommandResult RunCalibrate(const Arguments& arguments, CommandContext& context) {
  CommandResult result;
  const auto start = std::chrono::steady_clock::now();
  const calib::Board board = calib::ParseBoard(arguments.board);
  std::vector<calib::Footage> footage = OpenAll(arguments, &result);
  if (!calib::HasUniqueNumbering(board) && footage.size() > 1) {
    result.warnings.push_back({"CAL-AMBIGUOUS", "the board " + calib::ToString(board) + " looks the same after half a turn",
                               "use a chessboard with one odd and one even number of corners, or ChArUco"});
  }
  const auto found = calib::DetectFootage(board, footage, arguments.footage, context.run);
  const calib::CalibrateReport report = Calibrate(calib::ToCalibrateInput(board, found), arguments.calibrate, context.run);
  if (report.status != Status::kOk) {
    result.exit = kExitIllPosed;
    result.metrics["status"] = std::string(ToString(report.status));
    result.metrics["verdict"] = VerdictJson(report.verdict);
    result.errors.push_back({"CAL-UNSOLVED", report.message, "see metrics.status"});
    result.text = report.message + "\n";
    return result;
  }
  result.folder = arguments.out;
  const std::string path = arguments.out + "/calibration.json";
  MakeFolder(arguments.out);
  geometry::WriteRig(report.rig, path);
  result.outputs.push_back({path, "calibration"});
  FillMetrics(report, found, &result.metrics);
  result.metrics["wall_s"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  result.text = Summary(report, path);
  const bool failed = report.verdict.status == "fail";
  for (const auto& reason : report.verdict.reasons) result.warnings.push_back({reason.code, reason.text, reason.hint});
  if (failed) result.exit = kExitQualityGate;
  return result;
}

}  // namespace

void RegisterCalibrate(CLI::App& app, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = app.add_subcommand("calibrate", "Calibrate cameras from footage of a board");
  sub->add_option("--board", arguments->board,
                  "chessboard:COLSxROWS:SQUARE (inner corners) or charuco:COLSxROWS:SQUARE:MARKER[:DICT][:legacy]")
      ->required();
  sub->add_option("--camera", arguments->cameras, "NAME=PATH: a video, a folder or a pattern in quotes; repeat for each camera")
      ->required();
  sub->add_option("--out", arguments->out, "folder for calibration.json")->required();
  AddOptions(sub, arguments->footage);
  AddOptions(sub, arguments->calibrate);
  registry.Add(sub, "calibrate", [arguments](CommandContext& context) { return RunCalibrate(*arguments, context); });
}

}  // namespace mvstudio::cli
