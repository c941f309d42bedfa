#include "geometry/lens/camera.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/join.h"
#include "geometry/lens/lens_derivatives.h"

namespace mvstudio::geometry {
namespace {

constexpr std::string_view kNames[] = {"pinhole",  "brown1",      "brown2", "brown4", "brown5",         "rational8",
                                       "kannala4", "thinprism12", "ucm",    "eucm",   "doublesphere",   "pinhole_p",
                                       "brown1_p", "kannala4_p",  "ucm_p",  "eucm_p", "doublesphere_p", "splined"};
constexpr int kMaxControlPoints = 1 << 20;

std::vector<std::string> DistortionNames(LensModel model) {
  switch (model) {
    case LensModel::kKannalaBrandt4:
      return {"k1", "k2", "k3", "k4"};
    case LensModel::kUcm:
      return {"xi"};
    case LensModel::kEucm:
      return {"alpha", "beta"};
    case LensModel::kDoubleSphere:
      return {"xi", "alpha"};
    case LensModel::kPinholeP:
      return {"p1", "p2"};
    case LensModel::kBrown1P:
      return {"k1", "p1", "p2"};
    case LensModel::kKannalaBrandt4P:
      return {"k1", "k2", "k3", "k4", "p1", "p2"};
    case LensModel::kUcmP:
      return {"xi", "p1", "p2"};
    case LensModel::kEucmP:
      return {"alpha", "beta", "p1", "p2"};
    case LensModel::kDoubleSphereP:
      return {"xi", "alpha", "p1", "p2"};
    default:
      break;
  }
  std::vector<std::string> names = {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4"};
  names.resize(NumDistortionParams(model));
  return names;
}

/// The denominators on the optical axis must be positive.
std::string WhyUndefinedOnAxis(const Camera& camera) {
  switch (camera.model) {
    case LensModel::kUcm:
    case LensModel::kUcmP:
    case LensModel::kDoubleSphere:
    case LensModel::kDoubleSphereP:
      return camera.params[4] > -1 ? "" : "xi is " + std::to_string(camera.params[4]) + ", it must be above -1";
    case LensModel::kEucm:
    case LensModel::kEucmP:
      return camera.params[5] > 0 ? "" : "beta is " + std::to_string(camera.params[5]) + ", it must be above 0";
    default:
      return "";
  }
}

}  // namespace

namespace internal {
int NoFixedParamCount() {
  throw ContractViolation(
      "a splined lens has no fixed number of parameters: ask NumParams(camera), which knows its control grid");
}
}  // namespace internal

std::string_view ToString(LensModel model) { return kNames[static_cast<int>(model)]; }

std::optional<LensModel> LensModelFromString(std::string_view name) {
  for (const LensModel model : kAllLensModels) {
    if (ToString(model) == name) return model;
  }
  return std::nullopt;
}

std::string LensModelNames() { return Join(kNames, ", "); }

std::vector<LensModel> ModelsSimplestFirst() {
  std::vector<LensModel> models(std::begin(kAllLensModels), std::end(kAllLensModels) - 1);
  std::stable_sort(models.begin(), models.end(), [](LensModel a, LensModel b) { return NumParams(a) < NumParams(b); });
  return models;
}

std::vector<std::string> ParamNames(LensModel model) {
  std::vector<std::string> names = {"fx", "fy", "cx", "cy"};
  for (const std::string& name : DistortionNames(model)) names.push_back(name);
  return names;
}

int NumParams(const Camera& camera) {
  return camera.model == LensModel::kSplined ? 4 + camera.spline.NumControlParams() : NumParams(camera.model);
}

std::vector<std::string> ParamNames(const Camera& camera) {
  if (camera.model != LensModel::kSplined) return ParamNames(camera.model);
  std::vector<std::string> names = {"fx", "fy", "cx", "cy"};
  for (int row = 0; row < camera.spline.rows; ++row) {
    for (int col = 0; col < camera.spline.cols; ++col) {
      const std::string place = "_" + std::to_string(row) + "_" + std::to_string(col);
      names.push_back("ux" + place);
      names.push_back("uy" + place);
    }
  }
  return names;
}

Eigen::Matrix3d Camera::K() const {
  Eigen::Matrix3d matrix;
  matrix << fx(), 0, cx(), 0, fy(), cy(), 0, 0, 1;
  return matrix;
}

Camera MakePinhole(const std::string& name, int width_px, int height_px, double focal_px) {
  Camera camera;
  camera.name = name;
  camera.width_px = width_px;
  camera.height_px = height_px;
  camera.params = Eigen::Vector4d(focal_px, focal_px, 0.5 * (width_px - 1), 0.5 * (height_px - 1));
  Validate(camera);
  return camera;
}

Camera PinholeOf(const Camera& camera) {
  Camera pinhole = camera;
  pinhole.model = LensModel::kPinhole;
  pinhole.spline = {};
  pinhole.params = camera.params.head<4>();
  Eigen::Vector2d px;
  LensDerivatives derivatives;
  MVS_CHECK(ProjectLens(camera, Eigen::Vector3d::UnitZ(), &px, &derivatives),
            "camera '" << camera.name << "' has no projection on its optical axis");
  pinhole.params << derivatives.d_px_d_x_in_cam(0, 0), derivatives.d_px_d_x_in_cam(1, 1), px;
  return pinhole;
}

std::string WhyInvalidGrid(const SplineGrid& grid) {
  if (grid.order != 2 && grid.order != 3) return "the spline's order is " + std::to_string(grid.order) + ", it must be 2 or 3";
  const auto fits = [&](int count) { return count > grid.order && count <= kMaxControlPoints; };
  if (!fits(grid.cols) || !fits(grid.rows) || static_cast<int64_t>(grid.cols) * grid.rows > kMaxControlPoints) {
    return "a grid of " + std::to_string(grid.cols) + " x " + std::to_string(grid.rows) + " control points; at least " +
           std::to_string(grid.order + 1) + " each way are needed";
  }
  if (grid.fov_x_deg < 1 || grid.fov_x_deg > 359) {
    return "the spline's field of view is " + std::to_string(grid.fov_x_deg) + " deg, it must be 1 to 359";
  }
  return "";
}

std::string WhyInvalidLens(const Camera& camera) {
  if (camera.model == LensModel::kSplined) {
    const std::string why = WhyInvalidGrid(camera.spline);
    if (!why.empty()) return why;
  }
  if (camera.params.size() != NumParams(camera)) {
    return std::to_string(camera.params.size()) + " parameters given, " + std::string(ToString(camera.model)) + " has " +
           std::to_string(NumParams(camera));
  }
  if (!camera.params.allFinite()) return "a parameter is NaN or infinite";
  if (!(camera.fx() > 0 && camera.fy() > 0)) {
    return "focal lengths " + std::to_string(camera.fx()) + ", " + std::to_string(camera.fy()) + " px, they must be positive";
  }
  return WhyUndefinedOnAxis(camera);
}

void Validate(const Camera& camera) {
  const std::string who = "camera '" + camera.name + "': ";
  MVS_CHECK(camera.width_px > 0 && camera.height_px > 0, who << "image size " << camera.width_px << "x" << camera.height_px);
  const std::string why = WhyInvalidLens(camera);
  MVS_CHECK(why.empty(), who << why);
}

bool InImage(const Camera& camera, const Eigen::Vector2d& px) {
  return px[0] >= -0.5 && px[1] >= -0.5 && px[0] < camera.width_px - 0.5 && px[1] < camera.height_px - 0.5;
}

}  // namespace mvstudio::geometry
