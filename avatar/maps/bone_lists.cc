#include "avatar/maps/bone_lists.h"

#include <map>

#include "core/error.h"

namespace mvstudio::avatar {
namespace {

constexpr std::pair<int, int> kBody25Bones[] = {{17, 15}, {15, 0},  {0, 16}, {16, 18}, {0, 1},   {1, 8},   {1, 2},   {2, 3},
                                                {3, 4},   {1, 5},   {5, 6},  {6, 7},   {8, 9},   {9, 10},  {10, 11}, {11, 24},
                                                {11, 22}, {22, 23}, {8, 12}, {12, 13}, {13, 14}, {14, 21}, {14, 19}, {19, 20}};
/// Contours of the 70 points: jaw, brows, bridge and nostrils of the nose, eyes, lips; the last three kinds but the nose close.
struct Contour {
  int first, last;
  bool closed;
};
constexpr Contour kFace[] = {{0, 16, false}, {17, 21, false}, {22, 26, false}, {27, 30, false}, {31, 35, false},
                             {36, 41, true}, {42, 47, true},  {48, 59, true},  {60, 67, true}};

template <class Bones>
void AddBones(const Bones& bones, InputLayout* layout) {
  for (const auto& [a, b] : bones)
    layout->maps.push_back({"bone " + std::to_string(layout->maps.size()), {{a, b, {a, b}}}, false});
}

InputMap Hand(const std::string& name, int wrist) {
  InputMap map{name, {}, true};
  for (int finger = 0; finger < 5; ++finger) {
    const int base = wrist + 1 + 4 * finger;
    const std::vector<int> joints = {wrist, base, base + 1, base + 2, base + 3};
    for (size_t k = 0; k + 1 < joints.size(); ++k) map.lines.push_back({joints[k], joints[k + 1], joints});
  }
  return map;
}

InputMap Face(int first) {
  InputMap map{"face", {}, true};
  const auto line = [&](int a, int b) { map.lines.push_back({first + a, first + b, {first + a, first + b}}); };
  for (const Contour& c : kFace) {
    for (int k = c.first; k < c.last; ++k) line(k, k + 1);
    if (c.closed) line(c.last, c.first);
  }
  return map;
}

void AddExtras(InputLayout* layout) {
  const int face = layout->num_joints, left = face + kFaceJoints, right = left + kHandJoints;
  layout->num_joints += kExtraJoints;
  layout->maps.push_back(Hand("left hand", left));
  layout->maps.push_back(Hand("right hand", right));
  layout->maps.push_back(Face(face));
}

std::map<int, InputLayout> AllLayouts() {
  InputLayout panoptic, body25;
  AddBones(kBones, &panoptic);
  body25.num_joints = 25;
  AddBones(kBody25Bones, &body25);
  std::map<int, InputLayout> all = {{18, panoptic}, {21, panoptic}, {24, body25}, {27, body25}, {36, panoptic}};
  AddExtras(&all[21]);
  AddExtras(&all[27]);
  all[36].slopes = true;
  return all;
}

}  // namespace

const InputLayout& LayoutOf(int inputs) {
  static const std::map<int, InputLayout> all = AllLayouts();
  const auto found = all.find(inputs);
  if (found == all.end()) throw UsageError("option 'inputs' must be 18, 21, 24, 27 or 36, it is " + std::to_string(inputs));
  return found->second;
}

}  // namespace mvstudio::avatar
