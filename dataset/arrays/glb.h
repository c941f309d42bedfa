// Private: nlohmann's JSON, for the writers of glTF.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

/// glTF 2.0, binary (https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html): what its writers share.
namespace mvstudio::dataset::internal {

using GlbJson = nlohmann::ordered_json;

enum GlbTarget { kNoTarget = 0, kArrayBuffer = 34962, kElementBuffer = 34963 };

/// The document and its one buffer, whose views all begin at multiples of four bytes.
class GlbBuilder {
 public:
  GlbBuilder();

  /// Appends to a list of the document; index of the item.
  int Add(const char* list, GlbJson item);
  int Count(const char* list) const { return static_cast<int>(json_.at(list).size()); }
  void Set(const char* key, GlbJson value) { json_[key] = std::move(value); }

  /// Accessors over new views; `components` numbers an element: 1 to 4, or 16 for matrices column by column. Bounds are
  /// written for floats.
  int Floats(const std::vector<float>& values, size_t components, GlbTarget target = kNoTarget);
  int Shorts(const std::vector<uint16_t>& values, size_t components, GlbTarget target);
  int Words(const std::vector<uint32_t>& values, size_t components, GlbTarget target);
  /// A view of `size` bytes; its index.
  int View(const void* data, size_t size, GlbTarget target = kNoTarget);

  /// Throws UsageError beyond the 4 GiB of the format.
  std::string Glb() const;

 private:
  GlbJson json_ = GlbJson::object();
  std::string bytes_;
};

/// Appends x, y, z.
void AppendVector(std::vector<float>* values, const Eigen::Vector3d& v);
/// Appends x, y, z, w with the sign that is nearer to the four numbers before: interpolation takes the shorter way.
void AppendTurn(std::vector<float>* values, Eigen::Quaterniond q);

}  // namespace mvstudio::dataset::internal
