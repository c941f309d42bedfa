#include "body/skeleton_parts.h"

#include "core/check.h"

namespace mvstudio::body {
namespace {

constexpr const char* kFingers[] = {"Thumb", "Index", "Middle", "Ring", "Pinky"};

void AppendChain(int first, int last, int begin, Skeleton* skeleton) {
  for (int i = first; i < last; ++i) skeleton->bones.emplace_back(begin + i, begin + i + 1);
}

std::vector<std::pair<int, int>> MakeFaceMirror() {
  std::vector<std::pair<int, int>> pairs;
  const auto span = [&pairs](int right, int left, int count) {  // both ends run towards each other
    for (int i = 0; i < count; ++i) pairs.emplace_back(left - i, right + i);
  };
  span(0, 16, 8);   // jaw
  span(17, 26, 5);  // brows
  span(31, 35, 2);  // nostrils
  span(36, 45, 4);  // upper lids
  pairs.emplace_back(47, 40);
  pairs.emplace_back(46, 41);
  span(48, 54, 3);  // outer lips, upper
  pairs.emplace_back(55, 59);
  pairs.emplace_back(56, 58);
  span(60, 64, 2);  // inner lips, upper
  pairs.emplace_back(65, 67);
  pairs.emplace_back(69, 68);
  return pairs;
}

}  // namespace

void AppendHand(const std::string& side, bool with_wrist, Skeleton* skeleton) {
  int root = skeleton->Find(side + "Wrist");
  MVS_CHECK(root >= 0, "skeleton " << skeleton->name << " has no " << side << "Wrist");
  if (with_wrist) {
    skeleton->bones.emplace_back(root, static_cast<int>(skeleton->joints.size()));
    root = static_cast<int>(skeleton->joints.size());
    skeleton->joints.push_back(side + "HandWrist");
  }
  for (const char* finger : kFingers) {
    const int begin = static_cast<int>(skeleton->joints.size());
    for (int k = 1; k <= 4; ++k) skeleton->joints.push_back(side + finger + std::to_string(k));
    skeleton->bones.emplace_back(root, begin);
    AppendChain(0, 3, begin, skeleton);
  }
}

void AppendFace(int num_points, Skeleton* skeleton) {
  const int begin = static_cast<int>(skeleton->joints.size());
  const int nose = skeleton->Find("Nose");
  for (int i = 0; i < num_points; ++i) skeleton->joints.push_back("Face" + std::to_string(i));
  const auto bone = [&](int a, int b) { skeleton->bones.emplace_back(begin + a, begin + b); };
  skeleton->bones.emplace_back(nose, begin + 30);
  for (const auto& [first, last] :
       {std::pair{0, 16}, {17, 21}, {22, 26}, {27, 30}, {31, 35}, {36, 41}, {42, 47}, {48, 59}, {60, 67}}) {
    AppendChain(first, last, begin, skeleton);
  }
  bone(36, 41), bone(42, 47), bone(48, 59), bone(60, 67);  // closed lids and lips
  bone(0, 17), bone(16, 26), bone(27, 21), bone(27, 22);   // what hangs together in no drawing: jaw, brows, nose
  bone(30, 33), bone(27, 39), bone(27, 42), bone(33, 51), bone(51, 62);
  if (num_points > 68) bone(68, 39), bone(69, 42);
}

const std::vector<std::pair<int, int>>& FaceMirror() {
  static const std::vector<std::pair<int, int>> pairs = MakeFaceMirror();
  return pairs;
}

}  // namespace mvstudio::body
