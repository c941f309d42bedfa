#include "geometry/camera.h"

#include <cmath>

#include "core/check.h"

namespace mvstudio::geometry {
namespace {

constexpr std::string_view kNames[] = {"pinhole", "brown1", "brown2", "brown4", "brown5", "rational8", "kannala4"};

}  // namespace

std::string_view ToString(LensModel model) { return kNames[static_cast<int>(model)]; }

std::optional<LensModel> LensModelFromString(std::string_view name) {
  for (const LensModel model : kAllLensModels) {
    if (ToString(model) == name) return model;
  }
  return std::nullopt;
}

std::vector<std::string> ParamNames(LensModel model) {
  std::vector<std::string> names = {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
  if (model == LensModel::kKannalaBrandt4) names = {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"};
  names.resize(NumParams(model));
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

void Validate(const Camera& camera) {
  const std::string who = "camera '" + camera.name + "': ";
  MVS_CHECK(camera.width_px > 0 && camera.height_px > 0, who << "image size " << camera.width_px << "x" << camera.height_px);
  MVS_CHECK(camera.params.size() == NumParams(camera.model), who << camera.params.size() << " parameters given, "
                                                                 << ToString(camera.model) << " has "
                                                                 << NumParams(camera.model));
  MVS_CHECK(camera.params.allFinite(), who << "a parameter is NaN or infinite: " << camera.params.transpose());
  MVS_CHECK(camera.fx() > 0 && camera.fy() > 0, who << "focal lengths " << camera.fx() << ", " << camera.fy() << " px");
}

bool InImage(const Camera& camera, const Eigen::Vector2d& px) {
  return px[0] >= -0.5 && px[1] >= -0.5 && px[0] < camera.width_px - 0.5 && px[1] < camera.height_px - 0.5;
}

}  // namespace mvstudio::geometry
