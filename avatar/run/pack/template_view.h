#pragma once

#include <optional>

#include "avatar/body/body_template.h"
#include "avatar/body/fit/person_body.h"
#include "avatar/body/texture/bake.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig.h"

/// The posed body template in an image's camera: the raw maps of template_maps.h.
namespace mvstudio::avatar {

/// Vertices (3, V) of the template in a pose, metres, world; empty when neck, shoulders and hips do not determine the
/// trunk.
std::optional<Eigen::Matrix3Xf> PosedVertices(const body::BodyTemplate& body, const dataset::Coco19Pose& pose);

/// Same for a fitted body.
std::optional<Eigen::Matrix3Xf> PosedVertices(const body::PersonBody& person, const dataset::Coco19Pose& pose);

/// Fills `maps` (4, size_px, size_px) with the view of `crop` (square) at that many pixels, rasterised four times finer. A
/// pixel's part is the most frequent among its samples, u and v are their means; where the chart's ends meet in a pixel, of the
/// end at its middle. Without any sample on the template: all 0.
void FillTemplateMaps(const body::BodyTemplate& body, const Eigen::Matrix3Xf& vertices_in_world,
                      const geometry::RigCamera& crop, int size_px, float* maps);

/// Fills `colours` (3, size_px, size_px) with those of the textured body in the same view: not multiplied by its cover, and
/// beyond its outline those of the nearest pixel. Without any pixel on the body: all 0.
void FillTemplateColours(const body::BodyTemplate& body, const body::Textures& textures,
                         const Eigen::Matrix3Xf& vertices_in_world, const geometry::RigCamera& crop, int size_px,
                         uint8_t* colours);

}  // namespace mvstudio::avatar
