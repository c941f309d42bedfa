#include "calib/formats/format_camera.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/format.h"
#include "core/units.h"
#include "core/utf8.h"
#include "geometry/lens/skew.h"
#include "geometry/rig/lenses_only.h"
#include "geometry/rig/plausible.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::calib::internal {
namespace {

constexpr double kMaxSizePx = 1 << 20;

void CheckSize(double width_px, double height_px, const Place& place) {
  const auto is_size = [](double size) { return size >= 1 && size <= kMaxSizePx && size == std::floor(size); };
  if (is_size(width_px) && is_size(height_px)) return;
  throw FormatError(place.path, place.where,
                    "image size " + std::to_string(width_px) + " x " + std::to_string(height_px) + " px is out of range");
}

/// The perspective lens that has so many coefficients in OpenCV's order.
std::optional<geometry::LensModel> ModelOfCount(Eigen::Index count) {
  for (const geometry::LensModel model : geometry::kAllLensModels) {
    if (geometry::HasOpenCvOrder(model) && geometry::NumDistortionParams(model) == count) return model;
  }
  return std::nullopt;
}

}  // namespace

Eigen::Quaterniond MakeRotation(const Eigen::Matrix3d& matrix, const Place& place) {
  const std::string wrong = geometry::WhyNotARotation(matrix);
  if (!wrong.empty()) throw FormatError(place.path, place.where, wrong);
  return geometry::NearestRotation(matrix);
}

geometry::Camera MakeCamera(const std::string& name, double width_px, double height_px, const Eigen::Matrix3d& k,
                            const Eigen::VectorXd& distortion, bool fisheye, const Place& place) {
  const auto fail = [&](const std::string& what) { throw FormatError(place.path, place.where, what); };
  if (k(0, 2) == 0 && k(1, 2) == 0 && k(2, 0) > 0 && k(2, 1) > 0)
    fail(
        "this camera matrix is transposed, as MATLAB writes it (the principal point in its last row, counted from 1): write "
        "[[fx, 0, cx - 1], [0, fy, cy - 1], [0, 0, 1]]");
  if (k(1, 0) != 0 || k(2, 0) != 0 || k(2, 1) != 0 || k(2, 2) != 1)
    fail("not a camera matrix [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]");
  if (k(0, 1) != 0) fail("the camera matrix has skew " + std::to_string(k(0, 1)) + ", which no lens model here has");
  const Eigen::Index count = distortion.isZero(0) && !fisheye ? 0 : distortion.size();
  if (fisheye && count != 4) {
    fail("a fisheye lens has 4 distortion coefficients, these are " + std::to_string(count));
  }
  const auto model = fisheye ? geometry::LensModel::kKannalaBrandt4 : ModelOfCount(count);
  if (!model) {
    fail("no lens model has " + std::to_string(count) + " distortion coefficients (0, 1, 2, 4, 5, 8 and 12 are known)");
  }
  Eigen::VectorXd params(4 + count);
  params << k(0, 0), k(1, 1), k(0, 2), k(1, 2), distortion.head(count);
  return MakeModelCamera(name, width_px, height_px, *model, params, place);
}

geometry::RigCamera MakeRigCamera(const std::string& name, const Eigen::Vector2d& size_px, const Eigen::Matrix3d& k,
                                  const Eigen::VectorXd& distortion, bool fisheye, const ReadOptions& options,
                                  const Place& place, std::vector<Notice>* notes) {
  Eigen::Matrix3d plain = k;
  plain(0, 1) = 0;
  geometry::RigCamera camera;
  camera.camera = MakeCamera(name, size_px[0], size_px[1], plain, distortion, fisheye, place);
  if (k(0, 1) != 0) ReplaceSkew(k(0, 1), options, place.path, place.where, &camera, notes);
  return camera;
}

Eigen::Matrix3d CameraMatrix(double fx, double fy, double cx, double cy) {
  Eigen::Matrix3d k;
  k << fx, 0, cx, 0, fy, cy, 0, 0, 1;
  return k;
}

geometry::Camera Checked(geometry::Camera camera, double width_px, double height_px, const Place& place) {
  CheckSize(width_px, height_px, place);
  camera.width_px = static_cast<int>(width_px);
  camera.height_px = static_cast<int>(height_px);
  const std::string wrong = geometry::WhyInvalidLens(camera);
  if (!wrong.empty()) throw FormatError(place.path, place.where, wrong);
  return camera;
}

geometry::Camera MakeModelCamera(const std::string& name, double width_px, double height_px, geometry::LensModel model,
                                 const Eigen::VectorXd& params, const Place& place) {
  geometry::Camera camera;
  camera.name = name;
  camera.model = model;
  camera.params = params;
  return Checked(std::move(camera), width_px, height_px, place);
}

std::optional<OpenCvLens> ToOpenCvLens(const geometry::Camera& camera) {
  if (camera.model == geometry::LensModel::kKannalaBrandt4) return OpenCvLens{camera.params.tail(4), true};
  const auto terms = geometry::OpenCvTerms(camera);
  if (!terms) return std::nullopt;
  // OpenCV takes none, 4, 5, 8 or 12.
  const Eigen::Index own = camera.params.size() - 4, count = own == 0 ? 0 : std::max<Eigen::Index>(own, 4);
  return OpenCvLens{terms->head(count), false};
}

OpenCvLens OpenCvLensOf(const geometry::Camera& camera) {
  const auto lens = ToOpenCvLens(camera);
  if (!lens)
    throw ContractViolation("camera '" + camera.name + "': " + std::string(ToString(camera.model)) + " is not OpenCV's");
  return *lens;
}

Eigen::Quaterniond RotationFromVector(const Eigen::Vector3d& vector, const Place& place) {
  if (vector.norm() > 2 * kPi)
    throw FormatError(place.path, place.where,
                      "a rotation vector of " + Format("%.3g", vector.norm()) +
                          " radians is more than a full turn: are these degrees? radians were expected");
  return geometry::RotationExp(vector);
}

void AddCamera(geometry::RigCamera camera, const Place& place, geometry::Rig* rig) {
  if (camera.camera.name.empty()) throw FormatError(place.path, place.where, "the camera has no name");
  if (!IsUtf8(camera.camera.name)) {
    throw FormatError(place.path, place.where, "the camera name '" + Printable(camera.camera.name) + "' is not UTF-8");
  }
  if (rig->Find(camera.camera.name) >= 0) {
    throw FormatError(place.path, place.where, "the camera name '" + Printable(camera.camera.name) + "' is used twice");
  }
  rig->cameras.push_back(std::move(camera));
}

void StateLensesOnly(ImportedRig* imported) {
  imported->rig.gauge = geometry::kLensesOnly;
  imported->notes.push_back(
      {"CAL-NOPOSE", "no rotations and translations (R, T) were found in the file: the lenses are known, where the cameras stand is not",
       "give the file with them as well, or place the cameras: calibrate with option 'start', or calib refine with option "
       "'from-keypoints'"});
}

Notice UnitNote(double metres_per_unit) {
  return {
      "CAL-UNIT",
      "the format names no unit of length; translations are taken as " + Format("%g", metres_per_unit) + " m per unit",
      "pass option 'unit' mm, cm or m, that of the program that wrote the file; commands without this option take what calib "
      "convert makes of it"};
}

}  // namespace mvstudio::calib::internal

namespace mvstudio::calib {

void ReplaceSkew(double skew_px, const ReadOptions& options, const std::string& path, const std::string& where,
                 geometry::RigCamera* camera, std::vector<Notice>* notes) {
  const geometry::WithoutSkew nearest = geometry::ReplaceSkew(camera->camera, skew_px);
  const std::string what = "the camera matrix has skew " + Format("%.6g", skew_px) + " px, which no lens model here has";
  const std::string off = "off by " + Format("%.3g", nearest.worst_px) + " px at worst";
  constexpr double kNothing = 0.01;  // px; below what any calibration knows
  if (!(nearest.worst_px <= std::max(kNothing, options.allow_approximation_px))) {
    throw FormatError(path, where,
                      what + "; the nearest camera without it is " + off +
                          ": pass option 'allow-approximation' PX to calib convert or calib show to accept it");
  }
  notes->push_back({"CAL-APPROXIMATED",
                    "camera " + internal::Printable(camera->camera.name) + ": " + what +
                        "; half of it became a turn about the optical axis, " + off,
                    ""});
  geometry::Rigid3 turn;
  turn.rotation = nearest.turn;
  camera->camera = nearest.camera;
  camera->cam_from_world = turn * camera->cam_from_world;
}

}  // namespace mvstudio::calib
