#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "calib/formats/format_camera.h"
#include "calib/formats/formats.h"
#include "calib/formats/writers.h"
#include "core/check.h"
#include "core/error.h"
#include "core/format.h"
#include "geometry/lens/lens_fit.h"
#include "geometry/rig/rig_io.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

geometry::Rig Scaled(geometry::Rig rig, double metres_per_unit) {
  for (geometry::RigCamera& camera : rig.cameras) camera.cam_from_world.translation /= metres_per_unit;
  return rig;
}

struct Nearest {
  geometry::Camera camera;
  double error_px = 0;  ///< largest over the image
};

/// Largest distance between the pixels of one ray through both lenses, over the image of `from`; infinity where only `from`
/// sees it.
double LargestDifference(const geometry::Camera& from, const geometry::Camera& to) {
  constexpr int kCols = 64, kRows = 48;
  const geometry::Projector seen(from), projector(to);
  double largest = 0;
  for (int i = 0; i <= kCols; ++i) {
    for (int j = 0; j <= kRows; ++j) {
      const Eigen::Vector2d px((from.width_px - 1.0) * i / kCols, (from.height_px - 1.0) * j / kRows);
      const geometry::Unprojection ray = seen.Unproject(px);
      if (ray.status != Status::kOk) continue;
      const geometry::Projection projection = projector.Project(ray.ray_in_cam);
      if (projection.status != Status::kOk) return std::numeric_limits<double>::infinity();
      largest = std::max(largest, (projection.px - px).norm());
    }
  }
  return largest;
}

/// Of the lenses that the format has, the one that is nearest over the image; a simpler one unless another is clearly nearer.
std::optional<Nearest> NearestCarried(CalibrationFormat format, const geometry::Camera& camera) {
  constexpr int kSplineCols = 16;
  std::vector<LensModel> models = geometry::ModelsSimplestFirst();
  models.push_back(LensModel::kSplined);
  std::optional<Nearest> nearest;
  for (const LensModel model : models) {
    geometry::Camera shape = camera;
    shape.model = model;
    shape.spline = model == LensModel::kSplined ? geometry::SplineGridFor(camera, 3, kSplineCols) : geometry::SplineGrid();
    shape.params = Eigen::VectorXd::Zero(geometry::NumParams(shape));
    if (!CanCarry(format, shape)) continue;
    const geometry::LensFit fit = geometry::FitLens(camera, model, {}, shape.spline);
    if (fit.status != Status::kOk && fit.status != Status::kNotConverged) continue;
    const double error_px = LargestDifference(camera, fit.camera);
    if (std::isfinite(error_px) && (!nearest || error_px < 0.99 * nearest->error_px)) nearest = Nearest{fit.camera, error_px};
  }
  return nearest;
}

/// The same lens without terms at its end that are zero, where the format has that one.
std::optional<geometry::Camera> WithoutZeroTerms(CalibrationFormat format, const geometry::Camera& camera) {
  constexpr LensModel kLongestFirst[] = {LensModel::kThinPrism12, LensModel::kRational8, LensModel::kBrown5, LensModel::kBrown4,
                                         LensModel::kBrown2,      LensModel::kBrown1,    LensModel::kPinhole};
  const auto own = std::find(std::begin(kLongestFirst), std::end(kLongestFirst), camera.model);
  if (own == std::end(kLongestFirst)) return std::nullopt;
  geometry::Camera shorter = camera;
  for (auto model = own + 1; model != std::end(kLongestFirst); ++model) {
    shorter.model = *model;
    const Eigen::Index count = geometry::NumParams(shorter);
    if (!camera.params.tail(camera.params.size() - count).isZero(0)) break;
    shorter.params = camera.params.head(count);
    if (CanCarry(format, shorter)) return shorter;
  }
  return std::nullopt;
}

std::string PxText(double px) { return Format("%.3g", px); }

}  // namespace

bool NamesNoUnit(CalibrationFormat format) {
  return format != CalibrationFormat::kMvstudio && format != CalibrationFormat::kPanoptic && format != CalibrationFormat::kQca;
}

bool CanCarry(CalibrationFormat format, const geometry::Camera& camera) {
  const auto opencv = internal::ToOpenCvLens(camera);
  switch (format) {
    case CalibrationFormat::kMvstudio:
      return true;
    case CalibrationFormat::kPanoptic:
    case CalibrationFormat::kQca:
      return opencv && !opencv->fisheye && opencv->distortion.size() <= 5;
    case CalibrationFormat::kToml:
    case CalibrationFormat::kCaliscope:
    case CalibrationFormat::kOpenCvYaml:
      return opencv.has_value();
    case CalibrationFormat::kEasyMocap:
      return opencv && !opencv->fisheye;
    case CalibrationFormat::kMrcal:
      return internal::MrcalCanCarry(camera);
    case CalibrationFormat::kColmap:
    case CalibrationFormat::kColmapText:
      return internal::ColmapCanCarry(camera);
    case CalibrationFormat::kNerfstudio:
      return internal::NerfstudioCanCarry(camera);
    case CalibrationFormat::kKalibr:
      return internal::KalibrCanCarry(camera);
    default:
      break;
  }
  return false;
}

geometry::Rig RigForFormat(const geometry::Rig& rig, CalibrationFormat format, const WriteOptions& options,
                           const std::string& path, std::vector<Notice>* notes) {
  geometry::Rig fitting = rig;
  for (geometry::RigCamera& camera : fitting.cameras) {
    if (CanCarry(format, camera.camera)) continue;
    if (const auto shorter = WithoutZeroTerms(format, camera.camera)) {
      camera.camera = *shorter;
      camera.params_covariance.reset();
      continue;
    }
    const auto nearest = NearestCarried(format, camera.camera);
    const std::string lens = std::string(ToString(camera.camera.model));
    const std::string what = "its lens " + lens + " cannot be written as " + std::string(ToString(format));
    if (!nearest || !(nearest->error_px <= options.allow_approximation_px)) {
      throw FormatError(
          path, camera.camera.name,
          what + (nearest ? "; the nearest lens that can be, " + std::string(ToString(nearest->camera.model)) + ", is off by " +
                                PxText(nearest->error_px) +
                                " px at worst: pass option 'allow-approximation' PX to accept it, or choose another option 'to'"
                          : " and no lens of that format comes near it: choose another option 'to'"));
    }
    notes->push_back({"CAL-APPROXIMATED",
                      "camera " + camera.camera.name + ": " + what + "; written as " +
                          std::string(ToString(nearest->camera.model)) + ", off by " + PxText(nearest->error_px) +
                          " px at worst",
                      "keep the original beside it"});
    camera.camera = nearest->camera;
    camera.params_covariance.reset();
  }
  return fitting;
}

namespace {

/// Only mvstudio's own format knows cameras that are late.
std::optional<Notice> LostOffsetsNote(const geometry::Rig& rig, CalibrationFormat format) {
  constexpr double kLeast = 0.005;  // frames; below it an offset moves nothing that an image shows
  std::string late;
  for (const geometry::RigCamera& camera : rig.cameras) {
    const auto& offset = camera.time_offset;
    if (!offset || (std::abs(offset->frames) < kLeast && offset->rate == 0)) continue;
    late += (late.empty() ? "" : ", ") + camera.camera.name;
  }
  if (late.empty() || format == CalibrationFormat::kMvstudio) return std::nullopt;
  return Notice{"CAL-OFFSETSLOST",
                "the time offsets of " + late + " have no place in " + std::string(ToString(format)) +
                    ": what reads the file takes all cameras for synchronous",
                "keep the original beside it, and check it with that one (calib eval)"};
}

}  // namespace

ExportReport WriteCalibration(const geometry::Rig& rig, CalibrationFormat format, const std::string& path,
                              const WriteOptions& options) {
  MVS_CHECK(!rig.cameras.empty(), "a rig without cameras cannot be written");
  MVS_CHECK(options.metres_per_unit > 0, "metres per unit " << options.metres_per_unit);
  for (const geometry::RigCamera& camera : rig.cameras) Validate(camera.camera);
  ExportReport report;
  geometry::Rig out = RigForFormat(rig, format, options, path, &report.notes);
  if (const auto note = LostOffsetsNote(rig, format)) report.notes.push_back(*note);
  if (NamesNoUnit(format)) out = Scaled(std::move(out), options.metres_per_unit);
  switch (format) {
    case CalibrationFormat::kToml:
    case CalibrationFormat::kCaliscope:
      report.files = internal::WriteToml(out, path, format == CalibrationFormat::kCaliscope);
      break;
    case CalibrationFormat::kQca:
      report.files = internal::WriteQca(out, path, options.qca_distortion_divisor);
      if (const auto note = internal::QcaDivisorNote(rig, options.qca_distortion_divisor, true)) report.notes.push_back(*note);
      break;
    case CalibrationFormat::kOpenCvYaml:
      report.files = internal::WriteOpenCvYaml(out, path);
      break;
    case CalibrationFormat::kMrcal:
      report.files = internal::WriteMrcal(out, path);
      break;
    case CalibrationFormat::kColmap:
    case CalibrationFormat::kColmapText:
      report.files = internal::WriteColmap(out, path, format == CalibrationFormat::kColmapText);
      break;
    case CalibrationFormat::kNerfstudio:
      report.files = internal::WriteNerfstudio(out, path);
      break;
    case CalibrationFormat::kKalibr:
      report.files = internal::WriteKalibr(out, path);
      if (rig.cameras[0].cam_from_world.translation.norm() > 0 || rig.cameras[0].cam_from_world.rotation.vec().norm() > 0) {
        report.notes.push_back({"CAL-WORLDLOST", "Kalibr's chain has no world: the first camera becomes the origin", ""});
      }
      break;
    case CalibrationFormat::kEasyMocap:
      report.files = internal::WriteEasyMocap(out, path);
      break;
    case CalibrationFormat::kMvstudio:
      geometry::WriteRig(out, path);
      report.files = {path};
      break;
    case CalibrationFormat::kPanoptic:
      throw UsageError(path + ": Panoptic's calibration is written by dataset/panoptic/panoptic.h");
    default:
      throw UsageError(path + ": " + std::string(ToString(format)) + " is written by exports/export.h");
  }
  return report;
}

}  // namespace mvstudio::calib
