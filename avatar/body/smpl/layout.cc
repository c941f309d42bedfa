#include "avatar/body/smpl/layout.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/error.h"

namespace mvstudio::body::internal {
namespace {

using Role = BoneRole;

struct SmplJoint {
  const char* name;
  BoneRole role;
};
// The first joints of SMPL, SMPL+H and SMPL-X.
constexpr SmplJoint kSmplJoints[] = {{"pelvis", Role::kPelvis},
                                     {"left_hip", Role::kLeftThigh},
                                     {"right_hip", Role::kRightThigh},
                                     {"spine1", Role::kSpine},
                                     {"left_knee", Role::kLeftShin},
                                     {"right_knee", Role::kRightShin},
                                     {"spine2", Role::kSpine},
                                     {"left_ankle", Role::kLeftFoot},
                                     {"right_ankle", Role::kRightFoot},
                                     {"spine3", Role::kChest},
                                     {"left_foot", Role::kOther},
                                     {"right_foot", Role::kOther},
                                     {"neck", Role::kNeck},
                                     {"left_collar", Role::kLeftClavicle},
                                     {"right_collar", Role::kRightClavicle},
                                     {"head", Role::kHead},
                                     {"left_shoulder", Role::kLeftUpperArm},
                                     {"right_shoulder", Role::kRightUpperArm},
                                     {"left_elbow", Role::kLeftForearm},
                                     {"right_elbow", Role::kRightForearm},
                                     {"left_wrist", Role::kLeftHand},
                                     {"right_wrist", Role::kRightHand}};
constexpr int kNumSmplJoints = 22;
constexpr int kSmplParents[kNumSmplJoints] = {-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19};
constexpr int kNeckJoint = 12, kHeadJoint = 15;

/// Vertices of the nose, the left eye and ear, the right eye and ear.
using FaceVertices = std::array<int, 5>;
constexpr FaceVertices kSmplFace = {332, 2800, 583, 6260, 4071}, kSmplxFace = {9120, 9448, 6, 9929, 616};
constexpr int kFaceJoints[] = {1, 15, 16, 17, 18};

[[noreturn]] void FailShape(const std::string& path, const std::string& name, const std::vector<int64_t>& shape) {
  std::string text;
  for (const int64_t size : shape) text += (text.empty() ? "" : ", ") + (size < 0 ? std::string("N") : std::to_string(size));
  throw FormatError(path, name, "must have the shape (" + text + ")");
}

/// The array of this name with this shape, -1 for any size; nullptr when it is missing.
const NpyArray* FindArray(const std::map<std::string, NpyArray>& arrays, const std::string& path, const std::string& name,
                          const std::vector<int64_t>& shape) {
  const auto found = arrays.find(name);
  if (found == arrays.end()) return nullptr;
  const NpyArray& array = found->second;
  if (array.shape.size() != shape.size()) FailShape(path, name, shape);
  int64_t count = 1;
  for (size_t d = 0; d < shape.size(); ++d) {
    if (shape[d] >= 0 && array.shape[d] != shape[d]) FailShape(path, name, shape);
    count *= array.shape[d];
  }
  if (count != static_cast<int64_t>(array.values.size())) FailShape(path, name, array.shape);
  if (!std::all_of(array.values.begin(), array.values.end(), [](double x) { return std::abs(x) < 1e12; }))
    throw FormatError(path, name, "has numbers that are not finite or absurdly large");
  return &array;
}

const NpyArray& GetArray(const std::map<std::string, NpyArray>& arrays, const std::string& path, const std::string& name,
                         const std::vector<int64_t>& shape) {
  const NpyArray* const array = FindArray(arrays, path, name, shape);
  if (!array) throw FormatError(path, name, "is missing");
  return *array;
}

std::vector<int> CheckParents(const NpyArray& table, int num_bones, const std::string& path) {
  std::vector<int> parents(static_cast<size_t>(num_bones));
  for (int b = 0; b < num_bones; ++b) {
    const double parent = table.values[static_cast<size_t>(b)];
    const bool fits = b == 0 || (parent == std::floor(parent) && parent >= 0 && parent < b);
    if (!fits) throw FormatError(path, "kintree_table[0][" + std::to_string(b) + "]", "must be a joint before this one");
    parents[b] = b == 0 ? -1 : static_cast<int>(parent);
    if (b < kNumSmplJoints && parents[b] != kSmplParents[b])
      throw FormatError(path, "kintree_table[0][" + std::to_string(b) + "]", "is not the skeleton of SMPL");
  }
  return parents;
}

/// The bone that moves each vertex most.
std::vector<int> MainBones(const SmplLayout& layout) {
  std::vector<int> main(static_cast<size_t>(layout.num_vertices));
  for (int v = 0; v < layout.num_vertices; ++v) {
    const auto row = layout.weights->values.begin() + static_cast<std::ptrdiff_t>(v) * layout.num_bones;
    main[v] = static_cast<int>(std::max_element(row, row + layout.num_bones) - row);
  }
  return main;
}

/// Vertex with the largest value among those that the bone or its descendants move most; -1 when there is none.
template <class Value>
int ExtremeVertex(const SmplLayout& layout, const std::vector<int>& main, int bone, Value value) {
  int best = -1;
  for (int v = 0; v < layout.num_vertices; ++v) {
    int b = main[v];
    while (b > bone) b = layout.parents[b];
    if (b == bone && (best < 0 || value(v) > value(best))) best = v;
  }
  return best;
}

/// A body of another number of vertices: the nose is foremost, the ears are at the sides, the eyes above and between.
std::array<PointRule, 5> GuessFace(const SmplLayout& layout, const std::vector<int>& main, const Eigen::Matrix3Xd& x,
                                   const PointRule& head) {
  const auto extreme = [&](int axis, double sign) {
    const int v = ExtremeVertex(layout, main, kHeadJoint, [&](int i) { return sign * x(axis, i); });
    return v < 0 ? head : MeanRule({v});
  };
  const PointRule nose = extreme(1, -1), left = extreme(0, 1), right = extreme(0, -1), crown = extreme(2, 1);
  const auto eye = [&](const PointRule& ear) { return AddRules(AddRules(AddRules({}, nose, 0.55), ear, 0.35), crown, 0.1); };
  return {nose, eye(left), left, eye(right), right};
}

PointRule RegressorRow(const SmplLayout& layout, int bone) {
  PointRule rule;
  for (int v = 0; v < layout.num_vertices; ++v) {
    const double weight = layout.regressor->values[static_cast<size_t>(bone) * layout.num_vertices + v];
    if (weight != 0) rule.emplace_back(v, weight);
  }
  return rule;
}

void SetFaceRules(const SmplLayout& layout, const std::vector<int>& main, const Eigen::Matrix3Xd& x, RigRules* rules) {
  std::array<PointRule, 5> face;
  if (layout.num_vertices == 6890 || layout.num_vertices == 10475) {
    const FaceVertices& vertices = layout.num_vertices == 6890 ? kSmplFace : kSmplxFace;
    for (size_t i = 0; i < face.size(); ++i) face[i] = MeanRule({vertices[i]});
  } else {
    face = GuessFace(layout, main, x, rules->heads[kHeadJoint]);
  }
  for (size_t i = 0; i < face.size(); ++i) rules->coco19[kFaceJoints[i]] = face[i];
}

/// Ends of bones that no other bone continues: what lies farthest out, for the head its top.
void SetTailRules(const SmplLayout& layout, const std::vector<int>& main, const Eigen::Matrix3Xd& x, RigRules* rules) {
  for (int b = 0; b < layout.num_bones; ++b) {
    const Eigen::Vector3d head = ApplyRule(rules->heads[b], x);
    const auto far = [&](int v) { return b == kHeadJoint ? x(2, v) : (x.col(v) - head).norm(); };
    const int tip = ExtremeVertex(layout, main, b, far);
    const PointRule parent = rules->heads[std::max(0, layout.parents[b])];
    rules->tails[b] = tip >= 0 ? MeanRule({tip}) : AddRules(AddRules({}, rules->heads[b], 2), parent, -1);
  }
}

}  // namespace

std::vector<std::string> SmplArrayNames() {
  return {"v_template", "f", "weights", "J_regressor", "kintree_table", "shapedirs", "posedirs"};
}

SmplLayout CheckSmplLayout(const std::map<std::string, NpyArray>& arrays, const std::string& path) {
  SmplLayout layout;
  layout.vertices = &GetArray(arrays, path, "v_template", {-1, 3});
  const int64_t num_vertices = layout.vertices->shape[0];
  if (num_vertices < 1 || num_vertices > 1'000'000) throw FormatError(path, "v_template", "has no vertices, or too many");
  layout.weights = &GetArray(arrays, path, "weights", {num_vertices, -1});
  const int64_t num_bones = layout.weights->shape[1];
  if (num_bones < kNumSmplJoints || num_bones > 1000) throw FormatError(path, "weights", "has not the joints of SMPL");
  layout.num_vertices = static_cast<int>(num_vertices);
  layout.num_bones = static_cast<int>(num_bones);
  layout.regressor = &GetArray(arrays, path, "J_regressor", {num_bones, num_vertices});
  layout.parents = CheckParents(GetArray(arrays, path, "kintree_table", {2, num_bones}), layout.num_bones, path);
  layout.faces = &GetArray(arrays, path, "f", {-1, 3});
  for (const double v : layout.faces->values) {
    if (!(v >= 0 && v < static_cast<double>(num_vertices) && v == std::floor(v)))
      throw FormatError(path, "f", "must refer to vertices of v_template");
  }
  layout.shapes = FindArray(arrays, path, "shapedirs", {num_vertices, 3, -1});
  layout.pose = FindArray(arrays, path, "posedirs", {num_vertices, 3, 9 * (num_bones - 1)});
  return layout;
}

void SetSmplBones(const SmplLayout& layout, BodyTemplate* body) {
  body->bone_parents = layout.parents;
  for (int b = 0; b < layout.num_bones; ++b) {
    body->bone_names.push_back(b < kNumSmplJoints ? kSmplJoints[b].name : "joint " + std::to_string(b));
    body->bone_roles.push_back(b < kNumSmplJoints ? kSmplJoints[b].role : BoneRole::kOther);
  }
}

RigRules SmplRules(const SmplLayout& layout, const Eigen::Matrix3Xd& x, const BodyTemplate& body) {
  const std::vector<int> main = MainBones(layout);
  RigRules rules;
  for (int b = 0; b < layout.num_bones; ++b) rules.heads.push_back(RegressorRow(layout, b));
  rules.tails.resize(rules.heads.size());
  SetTailRules(layout, main, x, &rules);
  SetFaceRules(layout, main, x, &rules);
  rules.coco19[0] = rules.heads[kNeckJoint];
  CompleteRules(body, &rules);
  return rules;
}

}  // namespace mvstudio::body::internal
