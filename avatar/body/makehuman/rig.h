#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "avatar/body/makehuman/obj.h"
#include "avatar/body/rig_rules.h"

namespace mvstudio::body {

/// A rig of MakeHuman: bones whose ends are means of vertices.
struct MakeHumanRig {
  struct Bone {
    std::string name;
    int parent = -1;  // parents come first
    PointRule head, tail;
  };
  std::vector<Bone> bones;

  int Find(const std::string& name) const;  // -1 when absent
};

/// Reads rig.*.json. Joints are given by groups of `mesh` (strategy CUBE) or by vertices (MEAN). Throws FormatError with the
/// place.
MakeHumanRig ParseRig(const std::string& json, const std::string& path, const ObjMesh& mesh);

/// Reads weights.*.json: (bone, weight) of each of `num_vertices` vertices. Bones that the rig lacks and weights outside [0, 1]
/// are refused.
std::vector<std::vector<std::pair<int, double>>> ParseRigWeights(const std::string& json, const std::string& path,
                                                                 const MakeHumanRig& rig, int num_vertices);

}  // namespace mvstudio::body
