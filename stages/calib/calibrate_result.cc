#include "stages/calib/calibrate_result.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "calib/verdict/capture_advice.h"
#include "core/format.h"
#include "core/statistics.h"
#include "core/units.h"
#include "stages/input/calib_read.h"
#include "stages/report_fields.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

ordered_json CameraMetrics(const calib::CameraReport& camera, const calib::FootageDetections* found) {
  ordered_json json;
  json["name"] = camera.name;
  json["model"] = std::string(geometry::ToString(camera.model));
  json["model_reason"] = camera.model_reason;
  if (!camera.given_up.empty()) json["given_up"] = camera.given_up;
  if (camera.lens_held) json["lens_held"] = true, json["smooth_rms_px"] = FiniteOrNull(camera.smooth_rms_px);
  json["num_params"] = camera.num_params;
  json["focal_px"] = FiniteOrNull(camera.focal_px);
  json["focal_sigma_px"] = FiniteOrNull(camera.focal_sigma_px);
  json["rms_px"] = FiniteOrNull(camera.rms_px);
  json["alone_rms_px"] = FiniteOrNull(camera.alone_rms_px);
  json["sigma_px"] = FiniteOrNull(camera.sigma_px);
  json["holdout_rms_px"] = FiniteOrNull(camera.holdout_rms_px);
  json["holdout_median_px"] = FiniteOrNull(camera.holdout_median_px);
  json["holdout_gross_fraction"] = FiniteOrNull(camera.holdout_gross_fraction);
  if (!camera.shares_lens_with.empty()) json["shares_lens_with"] = camera.shares_lens_with;
  if (camera.time_offset_frames != 0) json["time_offset_frames"] = FiniteOrNull(camera.time_offset_frames);
  if (camera.time_rate != 0) json["time_rate"] = FiniteOrNull(camera.time_rate);
  if (found) json["num_images"] = found->num_images;
  json["num_views"] = camera.num_views;
  json["num_places"] = camera.num_places;
  json["num_lost_views"] = camera.num_lost_views;
  if (std::isfinite(camera.readout.sigma_frames)) {
    json["readout_frames"] = FiniteOrNull(camera.readout.frames);
    json["readout_sigma_frames"] = FiniteOrNull(camera.readout.sigma_frames);
    json["readout_shift_px"] = FiniteOrNull(camera.readout.shift_px);
  }
  json["repeat_correlation"] = FiniteOrNull(camera.repeat_correlation);
  json["num_corners"] = camera.num_corners;
  json["num_rejected"] = camera.num_rejected + (found ? found->num_corners_dropped : 0);
  json["coverage"] = FiniteOrNull(camera.coverage);
  json["valid_radius"] = FiniteOrNull(camera.valid_radius);
  json["covers_image"] = camera.covers_image;
  json["folded_share"] = FiniteOrNull(camera.folds.share);
  if (found) json["boards_not_used"] = found->reasons;
  return json;
}

/// False where the lens was held at a calibration that states no covariance of it.
bool LensSigmaKnown(const calib::CalibrateReport& report, size_t camera) {
  return camera < report.rig.cameras.size() && report.rig.cameras[camera].params_covariance.has_value();
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

double BaselineMm(const geometry::Rig& rig) {
  return 1e3 * (rig.cameras[0].CenterInWorld() - rig.cameras[1].CenterInWorld()).norm();
}

/// cameras[].coverage_cells: 8 rows of 10 counts of kept corners over the image.
void AddCoverage(const calib::CalibrateReport& report, ordered_json* metrics) {
  constexpr int kCols = 10, kRows = 8;
  std::vector<std::vector<std::vector<int>>> cells(report.cameras.size(),
                                                   std::vector<std::vector<int>>(kRows, std::vector<int>(kCols, 0)));
  for (const calib::CornerResidual& r : report.residuals) {
    if (r.rejected) continue;
    const geometry::Camera& camera = report.rig.cameras[r.camera_idx].camera;
    const int col = std::clamp(static_cast<int>((r.px.x() + 0.5) * kCols / camera.width_px), 0, kCols - 1);
    const int row = std::clamp(static_cast<int>((r.px.y() + 0.5) * kRows / camera.height_px), 0, kRows - 1);
    ++cells[r.camera_idx][row][col];
  }
  for (size_t c = 0; c < cells.size(); ++c) (*metrics)["cameras"][c]["coverage_cells"] = cells[c];
}

/// cameras[].uncertainty_map_px.
void AddMaps(const calib::CalibrateReport& report, ordered_json* metrics) {
  for (size_t c = 0; c < report.uncertainty_maps.size(); ++c) {
    const Eigen::MatrixXd& map = report.uncertainty_maps[c];
    ordered_json rows = ordered_json::array();
    for (Eigen::Index r = 0; r < map.rows(); ++r) {
      rows.push_back(ordered_json::array());
      for (Eigen::Index k = 0; k < map.cols(); ++k) rows.back().push_back(FiniteOrNull(std::round(map(r, k) * 1e4) / 1e4));
    }
    (*metrics)["cameras"][c]["uncertainty_map_px"] = rows;
  }
}

/// Time steps that each pair of cameras shares.
ordered_json Covisibility(const calib::CalibrateReport& report) {
  std::map<int64_t, std::set<int>> by_frame;
  for (const calib::CornerResidual& r : report.residuals) {
    if (!r.rejected) by_frame[r.frame_idx].insert(r.camera_idx);
  }
  const size_t n = report.cameras.size();
  std::vector<std::vector<int>> shared(n, std::vector<int>(n, 0));
  for (const auto& [frame, cameras] : by_frame) {
    for (int a : cameras) {
      for (int b : cameras) ++shared[a][b];
    }
  }
  return shared;
}

ordered_json FilmHints(const calib::CalibrateReport& report) {
  ordered_json json = ordered_json::array();
  for (const calib::FilmHint& hint : calib::CaptureAdvice(report)) json.push_back({{"code", hint.code}, {"text", hint.text}});
  return json;
}

void FillBoards(const calib::CalibrateReport& report, ordered_json* metrics) {
  ordered_json& m = *metrics;
  const auto& boards = report.board_metrics;
  m["board_edge_mm"] = {{"rms", FiniteOrNull(boards.edge_rms_mm)},
                        {"median", FiniteOrNull(boards.edge_median_mm)},
                        {"bias", FiniteOrNull(boards.edge_bias_mm)}};
  m["pair_distance_rms_mm"] = FiniteOrNull(boards.pair_rms_mm);
  m["pair_distance_bias_mm"] = FiniteOrNull(boards.pair_bias_mm);
  m["triangulated_points"] = {{"num", boards.num_points}, {"strays", boards.num_stray_points}};
  m["triangulated_rms_px"] = FiniteOrNull(boards.reprojection_rms_px);
  m["triangulated_median_px"] = FiniteOrNull(boards.reprojection_median_px);
  if (!report.board_warp_m.empty())
    m["board_warp_mm"] = {FiniteOrNull(1e3 * report.board_warp_m[0].x()), FiniteOrNull(1e3 * report.board_warp_m[0].y())};
  m["board_warp_reason"] = report.warp_reason;
  if (report.bending.num_frames > 0)
    m["board_bending"] = {{"rms_mm", FiniteOrNull(1e3 * report.bending.rms_m)},
                          {"variance_ratio", FiniteOrNull(report.bending.variance_ratio)},
                          {"sigmas", FiniteOrNull(report.bending.sigmas)}};
  if (!report.board_stretch.empty())
    m["board_stretch"] = {{"shear", FiniteOrNull(report.board_stretch[0].x())},
                          {"aspect", FiniteOrNull(report.board_stretch[0].y())}};
  m["board_stretch_reason"] = report.stretch_reason;
  if (!report.time_reason.empty()) m["time_offset_reason"] = report.time_reason;
  if (!report.frame_shift.empty()) m["frame_shift"] = report.frame_shift;
  for (const calib::FrameDrop& drop : report.frame_drops)
    m["frame_drops"].push_back({{"camera", report.cameras[static_cast<size_t>(drop.camera_idx)].name},
                                {"last_frame_before", drop.last_before},
                                {"first_frame_after", drop.frame},
                                {"lost", drop.count}});
  if (!report.frame_rates.empty()) m["frame_rates"] = calib::ToString(report.frame_rates, geometry::CameraNames(report.rig));
  if (report.free_boards) m["free_boards"] = RowsJson(report.board_moves);
}

}  // namespace

ordered_json CalibrateMetrics(const calib::CalibrateReport& report, const std::vector<calib::FootageDetections>& found) {
  ordered_json m = FieldsJson(report);
  if (report.rig.cameras.size() == 2) m["baseline_mm"] = FiniteOrNull(BaselineMm(report.rig));
  m["solve_s"] = FiniteOrNull(report.solve_s);
  m["num_frames"] = report.num_frames;
  m["num_corners"] = report.num_corners;
  m["gauge"] = GaugeText(report.rig.gauge);
  m["verdict"] = VerdictJson(report.verdict);
  m["uncertainty"] = FieldsJson(report.uncertainty);
  m["uncertainty"]["cameras"] = RowsJson(report.uncertainty.cameras);
  m["motions"] = RowsJson(report.motions);
  if (!report.rotated.empty()) m["turned_views"] = ordered_json::object();
  for (const calib::RotatedCamera& camera : report.rotated) m["turned_views"][camera.camera] = camera.num_rotated;
  m["film_next"] = FilmHints(report);
  FillBoards(report, &m);
  m["model_selection"] = RowsJson(report.selection);
  m["cameras"] = ordered_json::array();
  for (size_t c = 0; c < report.cameras.size(); ++c) {
    m["cameras"].push_back(CameraMetrics(report.cameras[c], c < found.size() ? &found[c] : nullptr));
    if (!LensSigmaKnown(report, c)) m["cameras"].back()["focal_sigma_px"] = nullptr;
  }
  AddCoverage(report, &m);
  AddMaps(report, &m);
  if (report.cameras.size() > 1) m["covisibility"] = Covisibility(report);
  m["residuals"] = ResidualSamples(report);
  return m;
}

CommandResult DescribeFilmGain(const calib::CalibrateReport& report, const std::vector<FilmGain>& gains) {
  CommandResult result;
  ordered_json& rows = result.metrics["film_gain"] = ordered_json::array();
  for (const FilmGain& gain : gains) {
    const std::string& name = report.cameras[static_cast<size_t>(gain.camera_idx)].name;
    rows.push_back({{"camera", name},
                    {"num_boards", gain.cam_from_board.size()},
                    {"corner_before_px", FiniteOrNull(gain.before_px)},
                    {"corner_after_px", FiniteOrNull(gain.after_px)}});
    const std::string before = std::isfinite(gain.before_px) ? Format("%.2f", gain.before_px) : "what is not determined";
    result.text += Format(
        "%s: %zu more boards, tilted, where its images lack corners would lower the uncertainty in their "
        "corners from %s to %.2f px\n",
        name.c_str(), gain.cam_from_board.size(), before.c_str(), gain.after_px);
  }
  return result;
}

ordered_json VerdictJson(const calib::Verdict& verdict) {
  ordered_json json{{"status", ToString(verdict.outcome())}, {"reasons", ordered_json::array()}};
  for (const auto& reason : verdict.reasons)
    json["reasons"].push_back({{"level", reason.fails ? "fail" : "warn"}, {"code", reason.code}, {"text", reason.text}});
  return json;
}

std::string VerdictLine(const calib::Verdict& verdict) {
  const auto& reasons = verdict.reasons;
  const auto failing = std::find_if(reasons.begin(), reasons.end(), [](const auto& reason) { return reason.fails; });
  const auto first = failing == reasons.end() ? reasons.begin() : failing;
  const auto more = std::count_if(reasons.begin(), reasons.end(), [](const auto& reason) { return reason.fails; }) - 1;
  std::string line = "verdict: " + std::string(ToString(verdict.outcome()));
  if (first != reasons.end()) line += ": " + first->text + " (" + first->code + ")";
  if (more > 0) line += Format(" and %d more", static_cast<int>(more));
  return line + "\n";
}

namespace {

std::string Volume(double mm) { return Format(", %.3f mm where the boards were", mm); }

/// Held-out boards judge the lens, those of the rig its place, too.
double LargerError(const calib::CameraReport& camera) { return std::fmax(camera.holdout_rms_px, camera.rms_px); }

/// Of three cameras or more: the one to look at first, with how the others do.
std::string WorstCamera(const calib::CalibrateReport& report) {
  if (report.cameras.size() < 3) return "";
  const auto worst = std::max_element(report.cameras.begin(), report.cameras.end(),
                                      [](const auto& a, const auto& b) { return LargerError(a) < LargerError(b); });
  std::vector<double> errors;
  for (const calib::CameraReport& camera : report.cameras) errors.push_back(LargerError(camera));
  return Format("worst camera: %s, %.3f px beside a median of %.3f px\n", worst->name.c_str(), LargerError(*worst),
                UpperMedian(std::move(errors)));
}

std::string Figure(double value, int decimals) { return std::isfinite(value) ? Format("%.*f", decimals, value) : "-"; }

/// fx/fy where pixels are not square, else the mean.
std::string FocalText(const calib::CalibrateReport& report, size_t i) {
  constexpr double kSquare = 0.01;
  const double mean = report.cameras[i].focal_px;
  if (i >= report.rig.cameras.size() || report.rig.cameras[i].camera.name != report.cameras[i].name) return Figure(mean, 2);
  const double fx = report.rig.cameras[i].camera.fx(), fy = report.rig.cameras[i].camera.fy();
  return std::abs(fx - fy) > kSquare * mean ? Figure(fx, 1) + "/" + Figure(fy, 1) : Figure(mean, 2);
}

std::string EdgeText(const calib::CalibrateReport& report, const std::string& camera) {
  for (const calib::CameraUncertainty& c : report.uncertainty.cameras) {
    if (c.name == camera) return Figure(c.edge_px, c.edge_px < 100 ? 2 : 0);
  }
  return "-";
}

}  // namespace

std::string CalibrateSummary(const calib::CalibrateReport& report) {
  std::string text = "camera              model      focal px  +-      rms px  held-out px  edge +- px  boards  coverage\n";
  for (size_t i = 0; i < report.cameras.size(); ++i) {
    const calib::CameraReport& c = report.cameras[i];
    const std::string held =
        c.focal_sigma_px == 0 ? "-" : Format("%.2f", c.focal_sigma_px);  // splined lenses have no focal length
    const std::string sigma = LensSigmaKnown(report, i) ? held : "?";
    text += Format("%-19s %-9s %9s  %-6s %7.3f  %11s  %10s  %6d  %6.0f %%\n", c.name.c_str(),
                   std::string(geometry::ToString(c.model)).c_str(), FocalText(report, i).c_str(), sigma.c_str(), c.rms_px,
                   Figure(c.holdout_rms_px, 3).c_str(), EdgeText(report, c.name).c_str(), c.num_views, 100 * c.coverage);
  }
  text += Format("rig: rms %.3f px, held-out %s px, %d corners in %d frames, %.1f %% rejected, world: %s\n", report.rms_px,
                 Figure(report.holdout_rms_px, 3).c_str(), report.num_corners, report.num_frames,
                 100 * report.rejected_fraction, GaugeText(report.rig.gauge).c_str());
  if (report.rig.cameras.size() == 2) {
    text += Format("baseline %.3f mm\n", BaselineMm(report.rig));
  }
  if (std::isfinite(report.uncertainty.centre_px)) {
    text += Format("uncertainty: %.3f px at the centre, %.3f px at the edge%s\n", report.uncertainty.centre_px,
                   report.uncertainty.edge_px,
                   std::isfinite(report.uncertainty.volume_mm) ? Volume(report.uncertainty.volume_mm).c_str() : "");
  }
  for (const calib::CameraReport& c : report.cameras) {
    if (!c.given_up.empty()) text += c.name + ": " + c.given_up + "\n";
  }
  return text + WorstCamera(report) + VerdictLine(report.verdict);
}

}  // namespace mvstudio::stages
