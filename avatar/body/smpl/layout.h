#pragma once

#include <map>
#include <string>
#include <vector>

#include "avatar/body/rig_rules.h"
#include "core/disk/npy.h"

/// What the arrays of SMPL's layout mean: internal to this folder.
namespace mvstudio::body::internal {

/// Checked arrays; those of `arrays` must outlive it.
struct SmplLayout {
  int num_vertices = 0, num_bones = 0;
  const NpyArray *vertices = nullptr, *faces = nullptr, *weights = nullptr, *regressor = nullptr;
  const NpyArray *shapes = nullptr, *pose = nullptr;  // nullptr where they are missing
  std::vector<int> parents;                           // (B)
};

/// Names of the arrays that are read.
std::vector<std::string> SmplArrayNames();
/// Throws FormatError with the array whose shape or numbers are not those of a body.
SmplLayout CheckSmplLayout(const std::map<std::string, NpyArray>& arrays, const std::string& path);

/// Names, parents and roles.
void SetSmplBones(const SmplLayout& layout, BodyTemplate* body);
/// Joints by the regressor; ends of bones and the face by vertices. `x` (3, V) in body.
RigRules SmplRules(const SmplLayout& layout, const Eigen::Matrix3Xd& x, const BodyTemplate& body);

}  // namespace mvstudio::body::internal
