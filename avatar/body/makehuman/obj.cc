#include "avatar/body/makehuman/obj.h"

#include <algorithm>

#include "avatar/body/makehuman/number_words.h"

namespace mvstudio::body {
namespace {

constexpr size_t kMostVertices = 10'000'000;

Eigen::Vector3d ParseVertex(const std::vector<std::string_view>& words, const std::string& path, const std::string& where) {
  if (words.size() < 4) throw FormatError(path, where, "a vertex has three coordinates");
  Eigen::Vector3d x;
  for (int k = 0; k < 3; ++k) x[k] = internal::NumberOf(words[k + 1], path, where);
  return x;
}

std::vector<int> ParseFace(const std::vector<std::string_view>& words, int num_vertices, const std::string& path,
                           const std::string& where) {
  if (words.size() < 4 || words.size() > 5) throw FormatError(path, where, "a face has three or four corners");
  std::vector<int> face;
  for (size_t k = 1; k < words.size(); ++k)
    face.push_back(internal::IndexOf(words[k].substr(0, words[k].find('/')), 1, num_vertices, path, where) - 1);
  return face;
}

}  // namespace

ObjMesh ParseObj(const std::string& text, const std::string& path) {
  ObjMesh mesh;
  std::vector<Eigen::Vector3d> vertices;
  std::string group;
  std::string_view rest = text;
  for (int number = 1; !rest.empty(); ++number) {
    const std::string where = "line " + std::to_string(number);
    const std::vector<std::string_view> words = internal::Words(internal::TakeLine(&rest));
    if (words.empty()) continue;
    if (words[0] == "v") {
      if (vertices.size() >= kMostVertices) throw FormatError(path, where, "too many vertices");
      vertices.push_back(ParseVertex(words, path, where));
    } else if (words[0] == "g") {
      group = words.size() > 1 ? words[1] : "";
    } else if (words[0] == "f") {
      mesh.faces[group].push_back(ParseFace(words, static_cast<int>(vertices.size()), path, where));
    }
  }
  mesh.vertices.resize(3, static_cast<Eigen::Index>(vertices.size()));
  for (size_t i = 0; i < vertices.size(); ++i) mesh.vertices.col(static_cast<Eigen::Index>(i)) = vertices[i];
  return mesh;
}

std::vector<int> GroupVertices(const ObjMesh& mesh, const std::string& group, const std::string& path) {
  const auto found = mesh.faces.find(group);
  if (found == mesh.faces.end()) throw FormatError(path, "", "has no group '" + group + "'");
  std::vector<int> vertices;
  for (const std::vector<int>& face : found->second) vertices.insert(vertices.end(), face.begin(), face.end());
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  return vertices;
}

}  // namespace mvstudio::body
