#include "stages/view/body_colours.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "avatar/body/mesh_raster.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/footage/image_bytes.h"
#include "geometry/rig/resize.h"

namespace mvstudio::stages {
namespace {

constexpr char kColoursMagic[] = "MVBTEX01";
constexpr size_t kColoursHead = 20;
constexpr uint64_t kMostCorners = 1'000'000;

template <class T>
T NumberAt(const std::string& bytes, size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

int IndexAt(const std::string& path, const std::string& bytes, size_t at, uint64_t count) {
  const auto index = NumberAt<uint32_t>(bytes, at);
  if (index >= count) throw FormatError(path, "", "names a vertex or a corner that it does not have: it is another body's");
  return static_cast<int>(index);
}

const uint8_t* AtlasPixel(const Image& atlas, const Eigen::Vector2d& uv) {
  const auto place = [](double share, int size) { return std::clamp(static_cast<int>(share * size), 0, size - 1); };
  return atlas.Pixel(place(uv.x(), atlas.width), place(uv.y(), atlas.height));
}

}  // namespace

BodyColours ReadBodyColours(const std::string& path, int64_t num_vertices) {
  const std::string bytes = ReadFile(path);
  if (bytes.size() < kColoursHead || bytes.compare(0, sizeof(kColoursMagic) - 1, kColoursMagic) != 0)
    throw FormatError(path, "", "holds no colours of a body: make it anew by mvstudio avatar fit");
  const uint64_t corners = NumberAt<uint32_t>(bytes, 8), faces = NumberAt<uint32_t>(bytes, 12),
                 image = NumberAt<uint32_t>(bytes, 16);
  if (corners > kMostCorners || faces > kMostCorners || kColoursHead + 8 * corners + 12 * faces + image != bytes.size())
    throw FormatError(path, "",
                      "has " + std::to_string(bytes.size()) + " bytes, not what its header says: it was cut, or changed");
  BodyColours colours;
  colours.uv.resize(2, static_cast<Eigen::Index>(corners)), colours.faces.resize(3, static_cast<Eigen::Index>(faces));
  size_t at = kColoursHead;
  for (uint64_t c = 0; c < corners; ++c, at += 4)
    colours.vertices.push_back(IndexAt(path, bytes, at, static_cast<uint64_t>(num_vertices)));
  for (Eigen::Index k = 0; k < colours.uv.size(); ++k, at += 2) colours.uv.data()[k] = NumberAt<uint16_t>(bytes, at) / 65535.0;
  for (Eigen::Index k = 0; k < colours.faces.size(); ++k, at += 4) colours.faces.data()[k] = IndexAt(path, bytes, at, corners);
  colours.atlas = dataset::ReadImageBytes(bytes.substr(at), path);
  return colours;
}

Image BodyInColours(const BodyColours& colours, const Eigen::Matrix3Xd& vertices, const geometry::RigCamera& camera,
                    int longer_side_px) {
  if (vertices.cols() == 0) return {};
  const int width = camera.camera.width_px, height = camera.camera.height_px;
  const double scale = std::min(1.0, static_cast<double>(longer_side_px) / std::max(width, height));
  const int small_width = std::max(1, static_cast<int>(std::lround(scale * width))),
            small_height = std::max(1, static_cast<int>(std::lround(scale * height)));
  const geometry::RigCamera small = geometry::Resized(
      camera, geometry::MapOfArea({0, 0, width, height}, small_width, small_height), small_width, small_height);
  body::BodyTemplate cut;  // the rasteriser needs no more of it
  cut.faces = colours.faces;
  cut.vertices.resize(3, static_cast<Eigen::Index>(colours.vertices.size()));
  for (size_t c = 0; c < colours.vertices.size(); ++c)
    cut.vertices.col(static_cast<Eigen::Index>(c)) = vertices.col(colours.vertices[c]).cast<float>();
  const body::FaceMap seen = body::RasterizeFaces(cut, cut.vertices, small);
  Image image(seen.width, seen.height, 4);
  for (size_t i = 0; i < seen.face.size(); ++i) {
    if (seen.face[i] < 0) continue;
    const Eigen::Vector3i corner = colours.faces.col(seen.face[i]);
    Eigen::Vector2d uv = Eigen::Vector2d::Zero();
    for (int k = 0; k < 3; ++k) uv += seen.barycentric[i][k] * colours.uv.col(corner[k]);
    std::copy_n(AtlasPixel(colours.atlas, uv), 3, &image.pixels[4 * i]);
    image.pixels[4 * i + 3] = 255;
  }
  return image;
}

}  // namespace mvstudio::stages
