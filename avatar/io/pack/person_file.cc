#include "avatar/io/pack/person_file.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "avatar/data/safetensors.h"
#include "core/error.h"

namespace mvstudio::avatar {
namespace {

using body::kNumParts;

/// Column-major (R, C) as a tensor (C, R).
template <class Matrix>
at::Tensor FromMatrix(const Matrix& matrix) {
  using Scalar = typename Matrix::Scalar;
  const auto type = std::is_same_v<Scalar, int> ? at::kInt : std::is_same_v<Scalar, float> ? at::kFloat : at::kDouble;
  at::Tensor out = at::empty({matrix.cols(), matrix.rows()}, type);
  std::copy_n(matrix.data(), matrix.size(), out.data_ptr<Scalar>());
  return out;
}

at::Tensor FromInts(const std::vector<int>& values) {
  at::Tensor out = at::empty({static_cast<int64_t>(values.size())}, at::kInt);
  std::copy(values.begin(), values.end(), out.data_ptr<int>());
  return out;
}

/// (F, 1 + B * 4 + 3): frame, quaternions x y z w, shift.
at::Tensor FromPoses(const std::map<int, body::ArticulatedPose>& poses, size_t num_bones) {
  at::Tensor out = at::empty({static_cast<int64_t>(poses.size()), static_cast<int64_t>(4 + 4 * num_bones)}, at::kDouble);
  double* to = out.data_ptr<double>();
  for (const auto& [frame, pose] : poses) {
    *to++ = frame;
    for (const Eigen::Quaterniond& q : pose.local_rotations) to = std::copy_n(q.coeffs().data(), 4, to);
    to = std::copy_n(pose.shift.data(), 3, to);
  }
  return out;
}

at::Tensor FromTextures(const body::Textures& textures) {
  const int size = textures[0].width;
  at::Tensor out = at::empty({kNumParts, size, size, 3}, at::kByte);
  uint8_t* to = out.data_ptr<uint8_t>();
  for (const Image& texture : textures) to = std::copy(texture.pixels.begin(), texture.pixels.end(), to);
  return out;
}

/// Reads and checks the tensors of one file.
class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path), file_(ReadTensorFile(path)) {}

  [[noreturn]] void Fail(const std::string& name, const std::string& why) const { throw FormatError(path_, name, why); }

  /// Rows of `columns` numbers; 0: any number of columns. Real numbers must be finite.
  at::Tensor Get(const std::string& name, at::ScalarType type, int64_t rows, int64_t columns) const {
    const auto found = file_.tensors.find(name);
    if (found == file_.tensors.end()) Fail(name, "is missing");
    const at::Tensor& tensor = found->second;
    const bool flat = columns == 1 && tensor.dim() == 1;
    if (tensor.scalar_type() != type || (!flat && tensor.dim() != 2)) Fail(name, "has another type or number of dimensions");
    if ((rows >= 0 && tensor.size(0) != rows) || (!flat && columns > 0 && tensor.size(1) != columns))
      Fail(name, "has another size than the rest of the body");
    if (tensor.is_floating_point() && !at::isfinite(tensor).all().item<bool>()) Fail(name, "is not finite");
    return tensor;
  }

  template <class Matrix>
  Matrix Read(const std::string& name, int64_t rows, int64_t columns) const {
    using Scalar = typename Matrix::Scalar;
    const auto type = std::is_same_v<Scalar, int> ? at::kInt : std::is_same_v<Scalar, float> ? at::kFloat : at::kDouble;
    const at::Tensor tensor = Get(name, type, rows, columns);
    Matrix out(tensor.size(1), tensor.size(0));
    std::copy_n(tensor.data_ptr<Scalar>(), out.size(), out.data());
    return out;
  }

  std::vector<int> Ints(const std::string& name, int64_t count, int low, int high) const {
    const at::Tensor tensor = Get(name, at::kInt, count, 1);
    std::vector<int> out(tensor.data_ptr<int>(), tensor.data_ptr<int>() + tensor.numel());
    for (const int value : out) RequireIndex(name, value, low, high);
    return out;
  }
  void RequireIndex(const std::string& name, int value, int low, int high) const {
    if (value < low || value > high)
      Fail(name, std::to_string(value) + " is not between " + std::to_string(low) + " and " + std::to_string(high));
  }

  const TensorFile& file() const { return file_; }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  TensorFile file_;
};

std::vector<std::string> ReadNames(const Reader& in) {
  const auto found = in.file().metadata.find("bone_names");
  if (found == in.file().metadata.end()) in.Fail("bone_names", "is missing");
  const auto json = nlohmann::json::parse(found->second, nullptr, false);
  std::vector<std::string> names;
  if (!json.is_array() || json.empty()) in.Fail("bone_names", "is no list of names");
  for (const auto& name : json) {
    if (!name.is_string()) in.Fail("bone_names", "is no list of names");
    names.push_back(name.get<std::string>());
  }
  return names;
}

void ReadSkeleton(const Reader& in, body::BodyTemplate* body) {
  body->bone_names = ReadNames(in);
  const auto bones = static_cast<int>(body->bone_names.size());
  body->bone_parents = in.Ints("bone_parents", bones, -1, bones - 1);
  for (int b = 0; b < bones; ++b) {
    if (body->bone_parents[b] >= b || (body->bone_parents[b] < 0) != (b == 0))
      in.Fail("bone_parents", "parents must come first");
  }
  for (const int role : in.Ints("bone_roles", bones, 0, body::kNumBoneRoles - 1))
    body->bone_roles.push_back(static_cast<body::BoneRole>(role));
  body->bone_heads = in.Read<Eigen::Matrix3Xd>("bone_heads", bones, 3);
  body->bone_tails = in.Read<Eigen::Matrix3Xd>("bone_tails", bones, 3);
  body->coco19 = in.Read<Eigen::Matrix3Xd>("coco19", 19, 3);
  const std::vector<int> of = in.Ints("coco19_bone", 19, 0, bones - 1);
  std::copy(of.begin(), of.end(), body->coco19_bone.begin());
}

void ReadSurface(const Reader& in, body::BodyTemplate* body) {
  const auto bones = static_cast<int>(body->bone_names.size());
  body->vertices = in.Read<Eigen::Matrix3Xf>("vertices", -1, 3);
  const auto vertices = static_cast<int>(body->vertices.cols());
  body->faces = in.Read<Eigen::Matrix3Xi>("faces", -1, 3);
  for (const int v : body->faces.reshaped()) in.RequireIndex("faces", v, 0, vertices - 1);
  body->face_part = in.Ints("face_part", body->faces.cols(), 1, kNumParts);
  body->face_uv = in.Read<Eigen::Matrix2Xf>("face_uv", 3 * body->faces.cols(), 2);
  if (body->face_uv.size() > 0 && (body->face_uv.minCoeff() < 0 || body->face_uv.maxCoeff() > 1))
    in.Fail("face_uv", "leaves [0, 1]");
  body->skin_bones = in.Read<Eigen::Matrix4Xi>("skin_bones", vertices, 4);
  for (const int b : body->skin_bones.reshaped()) in.RequireIndex("skin_bones", b, 0, bones - 1);
  body->skin_weights = in.Read<Eigen::Matrix4Xf>("skin_weights", vertices, 4);
  const Eigen::RowVectorXf sums = body->skin_weights.colwise().sum();
  if (((sums.array() - 1).abs() > 1e-3f).any()) in.Fail("skin_weights", "do not sum to one");
}

void ReadHabits(const Reader& in, size_t bones, body::RotationHabits* habits) {
  if (!in.file().tensors.count("habit_sigma")) return;
  const at::Tensor sigma = in.Get("habit_sigma", at::kDouble, static_cast<int64_t>(bones), 1);
  for (size_t b = 0; b < bones; ++b) {
    body::RotationHabits::Bone bone;
    bone.sigma_rad = sigma.data_ptr<double>()[b];
    const std::string name = "habit_weights." + std::to_string(b);
    if (in.file().tensors.count(name)) bone.weights = in.Read<Eigen::Matrix3Xd>(name, -1, 3);
    habits->bones.push_back(bone);
  }
}

void ReadPoses(const Reader& in, size_t bones, std::map<int, body::ArticulatedPose>* poses) {
  const at::Tensor rows = in.Get("poses", at::kDouble, -1, static_cast<int64_t>(4 + 4 * bones));
  const double* from = rows.data_ptr<double>();
  for (int64_t i = 0; i < rows.size(0); ++i) {
    body::ArticulatedPose pose;
    const double frame = *from++;
    if (!(std::abs(frame) < 1e9) || frame != std::floor(frame)) in.Fail("poses", "a frame number is not a whole number");
    for (size_t b = 0; b < bones; ++b, from += 4) {
      pose.local_rotations.emplace_back(Eigen::Map<const Eigen::Vector4d>(from));
      if (std::abs(pose.local_rotations.back().norm() - 1) > 1e-6) in.Fail("poses", "a rotation is not a unit quaternion");
    }
    pose.shift = Eigen::Map<const Eigen::Vector3d>(from), from += 3;
    (*poses)[static_cast<int>(frame)] = pose;
  }
}

void ReadTextures(const Reader& in, body::Textures* textures) {
  const auto found = in.file().tensors.find("textures");
  if (found == in.file().tensors.end()) in.Fail("textures", "is missing");
  const at::Tensor& all = found->second;
  if (all.scalar_type() != at::kByte || all.dim() != 4 || all.size(0) != kNumParts || all.size(1) != all.size(2) ||
      all.size(3) != 3 || all.size(1) < 2 || all.size(1) > 4096)
    in.Fail("textures", "are not 24 squares of RGB");
  const auto size = static_cast<int>(all.size(1));
  const uint8_t* from = all.data_ptr<uint8_t>();
  for (Image& texture : *textures) {
    texture = Image(size, size, 3);
    std::copy_n(from, texture.pixels.size(), texture.pixels.begin());
    from += texture.pixels.size();
  }
}

}  // namespace

void WritePerson(const TexturedPerson& person, const std::string& path) {
  const body::BodyTemplate& body = person.person.body;
  TensorFile file;
  file.metadata = {{"schema", kPersonSchema}, {"bone_names", nlohmann::json(body.bone_names).dump()}};
  auto& t = file.tensors;
  t["vertices"] = FromMatrix(body.vertices), t["faces"] = FromMatrix(body.faces);
  t["face_part"] = FromInts(body.face_part), t["face_uv"] = FromMatrix(body.face_uv);
  t["bone_parents"] = FromInts(body.bone_parents);
  std::vector<int> roles;
  for (const body::BoneRole role : body.bone_roles) roles.push_back(static_cast<int>(role));
  t["bone_roles"] = FromInts(roles);
  t["bone_heads"] = FromMatrix(body.bone_heads), t["bone_tails"] = FromMatrix(body.bone_tails);
  t["skin_bones"] = FromMatrix(body.skin_bones), t["skin_weights"] = FromMatrix(body.skin_weights);
  t["coco19"] = FromMatrix(body.coco19);
  t["coco19_bone"] = FromInts({body.coco19_bone.begin(), body.coco19_bone.end()});
  t["joint_sigma"] = at::full({1}, person.person.joint_sigma_m, at::kDouble);
  t["poses"] = FromPoses(person.person.seen, body.bone_names.size());
  t["textures"] = FromTextures(person.textures);
  const auto& habits = person.person.habits.bones;
  if (!habits.empty()) t["habit_sigma"] = at::empty({static_cast<int64_t>(habits.size())}, at::kDouble);
  for (size_t b = 0; b < habits.size(); ++b) {
    t["habit_sigma"].data_ptr<double>()[b] = habits[b].sigma_rad;
    if (habits[b].weights.size() > 0) t["habit_weights." + std::to_string(b)] = FromMatrix(habits[b].weights);
  }
  WriteTensorFile(file, path);
}

TexturedPerson ReadPerson(const std::string& path) {
  const Reader in(path);
  const auto schema = in.file().metadata.find("schema");
  if (schema == in.file().metadata.end() || schema->second != kPersonSchema)
    throw FormatError(path, "schema", std::string("is not ") + kPersonSchema);
  TexturedPerson person;
  ReadSkeleton(in, &person.person.body);
  ReadSurface(in, &person.person.body);
  const at::Tensor sigma = in.Get("joint_sigma", at::kDouble, 1, 1);
  person.person.joint_sigma_m = sigma.item<double>();
  if (!(person.person.joint_sigma_m > 0)) in.Fail("joint_sigma", "must be positive");
  const size_t bones = person.person.body.bone_names.size();
  ReadHabits(in, bones, &person.person.habits);
  ReadPoses(in, bones, &person.person.seen);
  ReadTextures(in, &person.textures);
  return person;
}

}  // namespace mvstudio::avatar
