#include "geometry/lens/camera.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "core/check.h"
#include "core/format.h"
#include "core/join.h"
#include "core/text/words.h"
#include "geometry/lens/lens_derivatives.h"

namespace mvstudio::geometry {
namespace {

constexpr int kMaxControlPoints = 1 << 20;
constexpr std::string_view kOpenCvOrder[] = {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4"};

/// The formula must be defined on the optical axis.
std::string WhyUndefinedOnAxis(const Camera& camera) {
  const LensTraits& traits = TraitsOf(camera.model);
  for (int i = 0; i < traits.num_params; ++i) {
    const LensParam& param = traits.params[i];
    if (camera.params[4 + i] > param.above) continue;
    return std::string(param.name) + Format(" is %f, it must be above %g", camera.params[4 + i], param.above);
  }
  return "";
}

}  // namespace

namespace internal {
int NoFixedParamCount() {
  throw ContractViolation(
      "a splined lens has no fixed number of parameters: ask NumParams(camera), which knows its control grid");
}

void NoSuchLensModel(LensModel model) {
  throw ContractViolation("there is no such use of lens model " + std::to_string(static_cast<int>(model)));
}
}  // namespace internal

std::string_view ToString(LensModel model) { return TraitsOf(model).name; }

std::optional<LensModel> LensModelFromString(std::string_view name) {
  for (const LensModel model : kAllLensModels) {
    if (PlainWord(ToString(model)) == PlainWord(name)) return model;
  }
  return std::nullopt;
}

std::string LensModelNames() {
  return Join(kAllLensModels, ", ", [](LensModel model) { return ToString(model); });
}

std::string_view ToString(const std::optional<LensModel>& model) { return model ? ToString(*model) : "auto"; }

namespace {

/// "; opencv8 is rational8 here" for the names of mrcal, OpenCV and Kalibr, or nothing.
std::string NameElsewhere(const std::string& text) {
  constexpr std::pair<std::string_view, LensModel> kElsewhere[] = {{"opencv4", LensModel::kBrown4},
                                                                   {"opencv5", LensModel::kBrown5},
                                                                   {"opencv8", LensModel::kRational8},
                                                                   {"opencv12", LensModel::kThinPrism12},
                                                                   {"opencv", LensModel::kBrown5},
                                                                   {"plumbbob", LensModel::kBrown5},
                                                                   {"radtan", LensModel::kBrown4},
                                                                   {"rationalpolynomial", LensModel::kRational8},
                                                                   {"fisheye", LensModel::kKannalaBrandt4},
                                                                   {"equidistant", LensModel::kKannalaBrandt4},
                                                                   {"kannalabrandt", LensModel::kKannalaBrandt4},
                                                                   {"ds", LensModel::kDoubleSphere}};
  constexpr std::string_view kPrefix = "lensmodel";
  std::string plain = PlainWord(text);
  if (plain.rfind(kPrefix, 0) == 0) plain.erase(0, kPrefix.size());
  for (const auto& [name, model] : kElsewhere) {
    if (plain == name) return "; " + text + " is " + std::string(ToString(model)) + " here";
  }
  return "";
}

}  // namespace

void FromString(const std::string& text, const std::string& option, std::optional<LensModel>* model) {
  const std::optional<LensModel> named = LensModelFromString(text);
  if (!named && PlainWord(text) != "auto")
    throw UsageError("option '" + option + "' " + text + ": no such lens model; there are auto, " + LensModelNames() +
                     NameElsewhere(text));
  *model = named;
}

std::vector<LensModel> ModelsSimplestFirst() {
  std::vector<LensModel> models;
  std::copy_if(std::begin(kAllLensModels), std::end(kAllLensModels), std::back_inserter(models),
               [](LensModel model) { return !TraitsOf(model).has_grid; });
  std::stable_sort(models.begin(), models.end(), [](LensModel a, LensModel b) { return NumParams(a) < NumParams(b); });
  return models;
}

std::vector<std::string> ParamNames(LensModel model) {
  std::vector<std::string> names = {"fx", "fy", "cx", "cy"};
  const LensTraits& traits = TraitsOf(model);
  if (traits.has_grid) internal::NoFixedParamCount();
  for (int i = 0; i < traits.num_params; ++i) names.emplace_back(traits.params[i].name);
  return names;
}

std::optional<LensModel> WithDecentring(LensModel model) {
  for (const LensModel other : kAllLensModels) {
    const LensTraits &more = TraitsOf(other), &less = TraitsOf(model);
    if (more.simpler == model && more.decentring >= 0 && less.decentring < 0 && more.num_params == less.num_params + 2) {
      return other;
    }
  }
  return std::nullopt;
}

int NumParams(const Camera& camera) {
  return TraitsOf(camera.model).has_grid ? 4 + camera.spline.NumControlParams() : NumParams(camera.model);
}

std::vector<std::string> ParamNames(const Camera& camera) {
  if (!TraitsOf(camera.model).has_grid) return ParamNames(camera.model);
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
  if (TraitsOf(camera.model).has_grid) {
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

std::optional<Eigen::Matrix<double, 12, 1>> OpenCvTerms(const Camera& camera) {
  const LensTraits& traits = TraitsOf(camera.model);
  if (!traits.opencv) return std::nullopt;
  Eigen::Matrix<double, 12, 1> terms = Eigen::Matrix<double, 12, 1>::Zero();
  for (int i = 0; i < traits.num_params; ++i) {
    const auto place = std::find(std::begin(kOpenCvOrder), std::end(kOpenCvOrder), traits.params[i].name);
    terms[place - std::begin(kOpenCvOrder)] = camera.params[4 + i];
  }
  return terms;
}

bool HasOpenCvOrder(LensModel model) {
  const LensTraits& traits = TraitsOf(model);
  const auto same = [](const LensParam& param, std::string_view name) { return param.name == name; };
  return traits.opencv && std::equal(traits.params, traits.params + traits.num_params, std::begin(kOpenCvOrder), same);
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
