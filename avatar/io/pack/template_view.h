#pragma once

#include <optional>

#include "body/body_template.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig.h"

/// The posed body template as a picture's camera sees it: template_maps.h's raw maps.
namespace mvstudio::avatar {

/// Vertices (3, V) of the template in a pose, metres, world; nothing when neck, shoulders and hips do not fix the trunk.
std::optional<Eigen::Matrix3Xf> PosedVertices(const body::BodyTemplate& body, const dataset::Coco19Pose& pose);

/// Fills `maps` (4, size_px, size_px) with what the view of `crop` (square) shows in that many pixels: rasterised four times
/// finer; a pixel's part is the most frequent among its samples, u and v are their means. Without any sample on the template:
/// all 0.
void FillTemplateMaps(const body::BodyTemplate& body, const Eigen::Matrix3Xf& vertices_in_world,
                      const geometry::RigCamera& crop, int size_px, float* maps);

}  // namespace mvstudio::avatar
