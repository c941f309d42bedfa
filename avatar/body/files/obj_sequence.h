#pragma once

#include <Eigen/Core>
#include <map>
#include <string>

#include "avatar/body/body_template.h"
#include "avatar/body/files/atlas.h"

namespace mvstudio::body {

/// A Wavefront OBJ of the body with its vertices at these places, (3, V) metres; coordinates as they are, z up. Texture
/// coordinates are those of the atlas, normals the vertices'. `material_file` is the MTL that defines the material "body".
std::string ObjOfBody(const BodyTemplate& body, const Eigen::Matrix3Xf& vertices, int chart_px,
                      const std::string& material_file);
/// The material "body" with this texture.
std::string MtlOfBody(const std::string& texture_file);

/// FRAME_%08d.obj for every frame, in world, and body.mtl and body.png, which they share. The folder is a work folder
/// (core/disk/output.h), or its files are replaced one by one.
void WriteObjSequence(const std::string& folder, const BodyTemplate& body, const AtlasPng& atlas,
                      const std::map<int, BodyPose>& pose_of_frame);

}  // namespace mvstudio::body
