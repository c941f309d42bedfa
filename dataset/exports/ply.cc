#include "dataset/exports/ply.h"

#include <cstring>

#include "dataset/exports/take.h"

namespace mvstudio::exports {

std::string PlyText(const std::vector<ColouredPoint>& points, const std::vector<std::pair<int, int>>& edges,
                    const std::vector<std::string>& comments) {
  std::string text = "ply\nformat ascii 1.0\n";
  for (const std::string& comment : comments) text += "comment " + comment + "\n";
  text += "element vertex " + std::to_string(points.size()) +
          "\nproperty double x\nproperty double y\nproperty double z\n"
          "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  if (!edges.empty()) {
    text += "element edge " + std::to_string(edges.size()) + "\nproperty int vertex1\nproperty int vertex2\n";
  }
  text += "end_header\n";
  for (const ColouredPoint& point : points) {
    for (int k = 0; k < 3; ++k) text += Num(point.x_in_world[k]) + " ";
    text += std::to_string(point.rgb[0]) + " " + std::to_string(point.rgb[1]) + " " + std::to_string(point.rgb[2]) + "\n";
  }
  for (const auto& [from, to] : edges) text += std::to_string(from) + " " + std::to_string(to) + "\n";
  return text;
}

std::string PlyBinary(const std::vector<ColouredPoint>& points) {
  std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(points.size()) +
                      "\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float ny\n"
                      "property float nz\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n";
  for (const ColouredPoint& point : points) {
    float numbers[6] = {};
    for (int k = 0; k < 3; ++k) numbers[k] = static_cast<float>(point.x_in_world[k]);
    bytes.append(reinterpret_cast<const char*>(numbers), sizeof numbers);
    bytes.append(reinterpret_cast<const char*>(point.rgb.data()), 3);
  }
  return bytes;
}

}  // namespace mvstudio::exports
