#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

namespace mvstudio::body {

/// Vertices and faces of a Wavefront OBJ file by its groups.
struct ObjMesh {
  Eigen::Matrix3Xd vertices;                                   // (3, V) in the file's frame and units
  std::map<std::string, std::vector<std::vector<int>>> faces;  // vertices of each face of a group, 3 or 4 of them
};

/// Reads `v`, `g` and `f` lines; texture and normal indices are left out, as are all other lines. Throws FormatError with the
/// line: faces refer to vertices before them.
ObjMesh ParseObj(const std::string& text, const std::string& path);

/// The group's vertices, each once, in ascending order. Throws FormatError when there is no such group.
std::vector<int> GroupVertices(const ObjMesh& mesh, const std::string& group, const std::string& path);

}  // namespace mvstudio::body
