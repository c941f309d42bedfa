#include "dataset/arrays/glb.h"

#include <algorithm>
#include <cstring>

#include "core/check.h"
#include "core/error.h"

namespace mvstudio::dataset::internal {
namespace {

enum GlbComponent { kUnsignedShort = 5123, kUnsignedInt = 5125, kFloat = 5126 };

const char* TypeOf(size_t components) {
  constexpr const char* kTypes[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
  MVS_CHECK((components >= 1 && components <= 4) || components == 16, components << " components");
  return components == 16 ? "MAT4" : kTypes[components - 1];
}

void AppendWord(size_t value, std::string* bytes) {
  const auto word = static_cast<uint32_t>(value);
  char raw[4];
  std::memcpy(raw, &word, 4);
  bytes->append(raw, 4);
}

GlbJson Accessor(int view, GlbComponent component, size_t count, size_t components) {
  return {{"bufferView", view},
          {"componentType", static_cast<int>(component)},
          {"count", count / components},
          {"type", TypeOf(components)}};
}

}  // namespace

GlbBuilder::GlbBuilder() {
  for (const char* key : {"nodes", "meshes", "materials", "cameras", "accessors", "bufferViews"}) json_[key] = GlbJson::array();
}

int GlbBuilder::Add(const char* list, GlbJson item) {
  json_[list].push_back(std::move(item));
  return static_cast<int>(json_[list].size()) - 1;
}

int GlbBuilder::Floats(const std::vector<float>& values, size_t components, GlbTarget target) {
  MVS_CHECK(!values.empty() && values.size() % components == 0, values.size() << " values of " << components);
  GlbJson low = GlbJson::array(), high = GlbJson::array();
  for (size_t c = 0; c < components; ++c) {
    float least = values[c], most = values[c];
    for (size_t i = c; i < values.size(); i += components) least = std::min(least, values[i]), most = std::max(most, values[i]);
    low.push_back(least), high.push_back(most);
  }
  GlbJson accessor = Accessor(View(values.data(), values.size() * sizeof(float), target), kFloat, values.size(), components);
  accessor["min"] = low, accessor["max"] = high;
  return Add("accessors", accessor);
}

int GlbBuilder::Shorts(const std::vector<uint16_t>& values, size_t components, GlbTarget target) {
  const int view = View(values.data(), values.size() * sizeof(uint16_t), target);
  return Add("accessors", Accessor(view, kUnsignedShort, values.size(), components));
}

int GlbBuilder::Words(const std::vector<uint32_t>& values, size_t components, GlbTarget target) {
  const int view = View(values.data(), values.size() * sizeof(uint32_t), target);
  return Add("accessors", Accessor(view, kUnsignedInt, values.size(), components));
}

int GlbBuilder::View(const void* data, size_t size, GlbTarget target) {
  GlbJson view = {{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", size}};
  if (target != kNoTarget) view["target"] = static_cast<int>(target);
  bytes_.append(static_cast<const char*>(data), size);
  bytes_.append((4 - bytes_.size() % 4) % 4, '\0');
  return Add("bufferViews", view);
}

std::string GlbBuilder::Glb() const {
  GlbJson json = {{"asset", {{"version", "2.0"}, {"generator", "mvstudio"}}}};
  if (!bytes_.empty()) json["buffers"] = GlbJson::array({{{"byteLength", bytes_.size()}}});
  for (const auto& [key, value] : json_.items()) {
    if (!value.is_array() || !value.empty()) json[key] = value;
  }
  std::string text = json.dump(-1, ' ', false, GlbJson::error_handler_t::replace);
  text.append((4 - text.size() % 4) % 4, ' ');
  const size_t total = 12 + 8 + text.size() + (bytes_.empty() ? 0 : 8 + bytes_.size());
  if (total > 0xffffffffu) throw UsageError(".glb: more than 4 GiB; choose fewer frames");
  std::string glb = "glTF";
  for (const size_t word : {size_t{2}, total, text.size()}) AppendWord(word, &glb);
  glb += "JSON" + text;
  if (bytes_.empty()) return glb;
  AppendWord(bytes_.size(), &glb);
  return glb + std::string("BIN\0", 4) + bytes_;
}

void AppendVector(std::vector<float>* values, const Eigen::Vector3d& v) {
  for (int k = 0; k < 3; ++k) values->push_back(static_cast<float>(v[k]));
}

void AppendTurn(std::vector<float>* values, Eigen::Quaterniond q) {
  const size_t n = values->size();
  if (n >= 4) {
    const Eigen::Quaterniond last((*values)[n - 1], (*values)[n - 4], (*values)[n - 3], (*values)[n - 2]);
    if (q.dot(last) < 0) q.coeffs() = -q.coeffs();
  }
  for (const double value : {q.x(), q.y(), q.z(), q.w()}) values->push_back(static_cast<float>(value));
}

}  // namespace mvstudio::dataset::internal
