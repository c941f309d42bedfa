#include "geometry/rig/resize.h"

#include <cmath>

#include "core/check.h"
#include "geometry/rig/rig_covariance.h"

namespace mvstudio::geometry {
namespace {

Eigen::VectorXd ParamScales(const PixelMap& map, Eigen::Index num_params) {
  Eigen::VectorXd scales = Eigen::VectorXd::Ones(num_params);
  scales.head<4>() << map.scale_x, map.scale_y, map.scale_x, map.scale_y;
  return scales;
}

}  // namespace

RigCamera Resized(const RigCamera& camera, const PixelMap& map, int width_px, int height_px) {
  MVS_CHECK(map.scale_x > 0 && map.scale_y > 0, "scales " << map.scale_x << ", " << map.scale_y);
  RigCamera out = camera;
  out.camera.width_px = width_px, out.camera.height_px = height_px;
  Eigen::VectorXd& p = out.camera.params;
  p[0] *= map.scale_x, p[1] *= map.scale_y;
  p[2] = map.scale_x * (p[2] + 0.5) + map.offset_x_px - 0.5;
  p[3] = map.scale_y * (p[3] + 0.5) + map.offset_y_px - 0.5;
  if (out.params_covariance) {
    const Eigen::VectorXd scales = ParamScales(map, p.size());
    *out.params_covariance = scales.asDiagonal() * *out.params_covariance * scales.asDiagonal();
  }
  return out;
}

void ResizeCamera(size_t camera, const PixelMap& map, int width_px, int height_px, Rig* rig) {
  StatedCovariance stated = StatedCovarianceOf(*rig);
  RigCamera& resized = rig->cameras.at(camera);
  const Eigen::VectorXd scales = ParamScales(map, resized.camera.params.size());
  stated.joint.middleRows(stated.begin[camera], scales.size()).array().colwise() *= scales.array();
  stated.joint.middleCols(stated.begin[camera], scales.size()).array().rowwise() *= scales.transpose().array();
  resized = Resized(resized, map, width_px, height_px);
  StoreCovariance(stated, rig);
}

PixelMap MapOfArea(const PixelArea& area, int width_px, int height_px) {
  MVS_CHECK(area.width_px > 0 && area.height_px > 0, "an area of " << area.width_px << " x " << area.height_px);
  PixelMap map;
  map.scale_x = static_cast<double>(width_px) / area.width_px, map.scale_y = static_cast<double>(height_px) / area.height_px;
  map.offset_x_px = -map.scale_x * area.x, map.offset_y_px = -map.scale_y * area.y;
  return map;
}

bool KeepsAspect(const PixelArea& area, int width_px, int height_px) {
  const double by_width = static_cast<double>(width_px) / area.width_px,
               by_height = static_cast<double>(height_px) / area.height_px;
  return std::abs(by_width * area.height_px - height_px) < 1 || std::abs(by_height * area.width_px - width_px) < 1;
}

}  // namespace mvstudio::geometry
