#include "avatar/splats/files/cloud_file.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "avatar/splats/splat_view.h"
#include "core/disk/files.h"
#include "core/disk/npy_write.h"
#include "core/error.h"
#include "dataset/arrays/npz.h"

namespace mvstudio::splats {
namespace {

constexpr size_t kMaxBytes = size_t{1} << 30;

const char* NameOf(Group group) {
  switch (group) {
    case Group::kPlace:
      return "place";
    case Group::kOffset:
      return "offset_m";
    case Group::kScale:
      return "log_scale";
    case Group::kRotation:
      return "rotation";
    case Group::kOpacity:
      return "opacity";
    case Group::kColour:
      return "colour";
    case Group::kBend:
      return "bend";
  }
  return "";
}

/// Of the array of a kind, of N Gaussians with `width` numbers each.
std::vector<size_t> ShapeOf(Group group, int width, size_t n, int degree) {
  if (group == Group::kColour) return {n, static_cast<size_t>(BasisSize(degree)), 3};
  if (group == Group::kBend) return {n, kBendBones, 3, kBendKinds};
  if (width == 1) return {n};
  return {n, static_cast<size_t>(width)};
}

/// The four bones that move a Gaussian most: those of the corners, weighted as its place is.
struct Skin {
  std::vector<int64_t> bones;  // (N, 4)
  std::vector<float> weights;  // (N, 4) sum to one
};

void AddSkin(const Cloud& cloud, size_t i, const body::BodyTemplate& body, Skin* skin) {
  const float w1 = std::clamp(cloud.values.place[2 * i], 0.f, 1.f), w2 = std::clamp(cloud.values.place[2 * i + 1], 0.f, 1 - w1);
  const float corner[3] = {1 - w1 - w2, w1, w2};
  std::map<int, float> total;
  for (int k = 0; k < 3; ++k) {
    const int vertex = body.faces(k, cloud.face[i]);
    for (int b = 0; b < 4; ++b) total[body.skin_bones(b, vertex)] += corner[k] * body.skin_weights(b, vertex);
  }
  std::vector<std::pair<float, int>> order;
  for (const auto& [bone, weight] : total) order.emplace_back(-weight, bone);
  std::sort(order.begin(), order.end());
  order.resize(4, {0.f, 0});
  float sum = 0;
  for (const auto& [weight, bone] : order) sum -= weight;
  for (const auto& [weight, bone] : order) skin->bones.push_back(bone), skin->weights.push_back(-weight / sum);
}

using Members = std::map<std::string, std::string>;

NpyArray Take(const std::string& path, Members* members, const std::string& name) {
  const auto found = members->find(name);
  if (found == members->end()) throw FormatError(path, name, "is missing");
  NpyArray array = ParseNpy(found->second, path + ": " + name);
  members->erase(found);
  return array;
}

/// `shape`, of finite numbers.
NpyArray TakeShaped(const std::string& path, Members* members, const std::string& name, const std::vector<int64_t>& shape) {
  NpyArray array = Take(path, members, name);
  if (array.shape != shape) throw FormatError(path, name, "has another size than face asks for");
  for (size_t i = 0; i < array.values.size(); ++i)
    if (!std::isfinite(array.values[i]))
      throw FormatError(path, name + "[" + std::to_string(i) + "]", "is not a finite number");
  return array;
}

std::vector<float> Floats(const NpyArray& array) { return {array.values.begin(), array.values.end()}; }

/// One whole number.
int64_t TakeWhole(const std::string& path, Members* members, const std::string& name, int64_t low, int64_t high) {
  const double value = TakeShaped(path, members, name, {1}).values[0];
  if (!(value >= static_cast<double>(low) && value <= static_cast<double>(high)) || value != std::floor(value))
    throw FormatError(path, name, "is not a whole number from " + std::to_string(low) + " to " + std::to_string(high));
  return static_cast<int64_t>(value);
}

/// One text.
std::string TakeText(const std::string& path, Members* members, const std::string& name) {
  const auto found = members->find(name);
  if (found == members->end()) throw FormatError(path, name, "is missing");
  const std::vector<std::string> texts = ParseNpyTexts(found->second, path + ": " + name);
  members->erase(found);
  if (texts.size() != 1) throw FormatError(path, name, "is not one text");
  return texts[0];
}

/// Texts "name=value"; none where older versions wrote the file.
std::map<std::string, std::string> TakeOptions(const std::string& path, Members* members) {
  std::map<std::string, std::string> options;
  const auto found = members->find("options");
  if (found == members->end()) return options;
  for (const std::string& text : ParseNpyTexts(found->second, path + ": options")) {
    const size_t equals = text.find('=');
    if (equals == 0 || equals == std::string::npos) throw FormatError(path, "options", "holds a text that is not NAME=VALUE");
    if (!options.emplace(text.substr(0, equals), text.substr(equals + 1)).second)
      throw FormatError(path, "options", "names '" + text.substr(0, equals) + "' twice");
  }
  members->erase(found);
  return options;
}

void TakeCloud(const std::string& path, int num_faces, Members* members, Cloud* cloud) {
  const NpyArray face = Take(path, members, "face");
  if (face.shape.size() != 1) throw FormatError(path, "face", "is no list");
  for (size_t i = 0; i < face.values.size(); ++i) {
    const double value = face.values[i];
    if (!(value >= 0 && value < num_faces) || value != std::floor(value))
      throw FormatError(path, "face[" + std::to_string(i) + "]",
                        "is none of the body's " + std::to_string(num_faces) + " faces");
    cloud->face.push_back(static_cast<int>(value));
  }
  const int64_t n = face.shape[0];
  const int degree = static_cast<int>(TakeWhole(path, members, "degree", 0, kMaxDegree));
  cloud->filter_variance = Floats(TakeShaped(path, members, "filter_variance_m2", {n}));
  cloud->values.degree = degree, cloud->values.bends = members->count("bend") > 0;
  ForEachGroup(cloud->values, [&](Group group, int width, std::vector<float>& array) {
    const std::vector<size_t> sides = ShapeOf(group, width, static_cast<size_t>(n), degree);
    const std::vector<int64_t> shape(sides.begin(), sides.end());
    array = Floats(TakeShaped(path, members, NameOf(group), shape));
  });
}

}  // namespace

std::string CloudFileBytes(const CloudFile& file, const body::BodyTemplate& body) {
  const Cloud& cloud = file.cloud;
  CheckCloud(cloud, static_cast<int>(body.faces.cols()));
  const size_t n = cloud.size();
  std::vector<std::pair<std::string, std::string>> members = {{"schema", NpyOfTexts({kCloudSchema})},
                                                              {"mip", NpyOfInts({1}, {file.mip ? 1 : 0})},
                                                              {"size_px", NpyOfInts({1}, {file.size_px})},
                                                              {"step", NpyOfInts({1}, {file.step})},
                                                              {"seed", NpyOfTexts({std::to_string(file.seed)})},
                                                              {"train_s", NpyOfDoubles({1}, {file.train_s})},
                                                              {"degree", NpyOfInts({1}, {cloud.values.degree})},
                                                              {"face", NpyOfInts({n}, {cloud.face.begin(), cloud.face.end()})},
                                                              {"filter_variance_m2", NpyOfFloats({n}, cloud.filter_variance)}};
  ForEachGroup(cloud.values, [&](Group group, int width, const std::vector<float>& array) {
    const std::vector<size_t> shape = ShapeOf(group, width, n, cloud.values.degree);
    members.emplace_back(NameOf(group), NpyOfFloats(shape, array));
  });
  std::vector<std::string> options;
  for (const auto& [name, value] : file.options) options.push_back(name + "=" + value);
  if (!options.empty()) members.emplace_back("options", NpyOfTexts(options));
  Skin skin;
  for (size_t i = 0; i < n; ++i) AddSkin(cloud, i, body, &skin);
  members.emplace_back("skin_bones", NpyOfInts({n, 4}, skin.bones));
  members.emplace_back("skin_weights", NpyOfFloats({n, 4}, skin.weights));
  members.emplace_back("bone_names", NpyOfTexts(body.bone_names));
  return NpzOf(members);
}

CloudFile ParseCloud(const std::string& bytes, const std::string& path, int num_faces) {
  Members members = dataset::ParseNpzMembers(bytes, path, kMaxBytes);
  CloudFile file;
  if (TakeText(path, &members, "schema") != kCloudSchema)
    throw FormatError(path, "schema", std::string("is not ") + kCloudSchema + ": written by another version");
  TakeCloud(path, num_faces, &members, &file.cloud);
  file.mip = TakeWhole(path, &members, "mip", 0, 1) == 1;
  file.size_px = static_cast<int>(TakeWhole(path, &members, "size_px", 0, 1 << 16));
  file.step = TakeWhole(path, &members, "step", 0, int64_t{1} << 40);
  file.options = TakeOptions(path, &members);
  file.train_s = TakeShaped(path, &members, "train_s", {1}).values[0];
  const std::string seed = TakeText(path, &members, "seed");
  if (seed.empty() || seed.size() > 20 || seed.find_first_not_of("0123456789") != std::string::npos)
    throw FormatError(path, "seed", "is not a whole number");
  file.seed = std::stoull(seed);
  return file;
}

void WriteCloud(const CloudFile& file, const body::BodyTemplate& body, const std::string& path) {
  WriteFileAtomic(path, CloudFileBytes(file, body));
}

CloudFile ReadCloud(const std::string& path, int num_faces) { return ParseCloud(ReadFile(path), path, num_faces); }

}  // namespace mvstudio::splats
