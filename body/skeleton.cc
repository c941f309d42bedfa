#include "body/skeleton.h"

#include <algorithm>

#include "core/check.h"
#include "core/error.h"

namespace mvstudio::body {
namespace {

using NamePairs = std::vector<std::pair<std::string, std::string>>;

const NamePairs kFace = {{"Nose", "LEye"}, {"LEye", "LEar"}, {"Nose", "REye"}, {"REye", "REar"}};
const NamePairs kArms = {{"LShoulder", "LElbow"}, {"LElbow", "LWrist"}, {"RShoulder", "RElbow"}, {"RElbow", "RWrist"}};
const NamePairs kLegs = {{"LHip", "LKnee"}, {"LKnee", "LAnkle"}, {"RHip", "RKnee"}, {"RKnee", "RAnkle"}};
const NamePairs kFeet = {{"LAnkle", "LBigToe"}, {"LBigToe", "LSmallToe"}, {"LAnkle", "LHeel"},
                         {"RAnkle", "RBigToe"}, {"RBigToe", "RSmallToe"}, {"RAnkle", "RHeel"}};
const NamePairs kNeckToHead = {{"Neck", "Nose"}, {"Neck", "LShoulder"}, {"Neck", "RShoulder"}};
const NamePairs kNeckToHips = {{"Neck", "LHip"}, {"Neck", "RHip"}};
const NamePairs kMidHip = {{"Neck", "MidHip"}, {"MidHip", "LHip"}, {"MidHip", "RHip"}};
const NamePairs kBox = {{"LShoulder", "RShoulder"}, {"LShoulder", "LHip"}, {"RShoulder", "RHip"}, {"LHip", "RHip"}};
const NamePairs kUpperNeck = {{"LShoulder", "Neck"}, {"RShoulder", "Neck"}, {"Neck", "Head"}, {"Neck", "Nose"}};

Skeleton MakeSkeleton(const std::string& name, std::vector<std::string> joints, const std::vector<NamePairs>& groups) {
  Skeleton skeleton{name, std::move(joints), {}};
  for (const NamePairs& group : groups) {
    for (const auto& [a, b] : group) {
      const int i = skeleton.Find(a), j = skeleton.Find(b);
      MVS_CHECK(i >= 0 && j >= 0, "skeleton " << name << " has no bone " << a << "-" << b);
      skeleton.bones.emplace_back(i, j);
    }
  }
  return skeleton;
}

// Orders: OpenPose's poseParameters.cpp (BODY_25, BODY_25B, COCO), COCO's key-point order, CMU Panoptic's joints19.
std::vector<Skeleton> MakeAll() {
  return {
      MakeSkeleton("body25", {"Nose", "Neck",    "RShoulder", "RElbow", "RWrist",  "LShoulder", "LElbow", "LWrist", "MidHip",
                              "RHip", "RKnee",   "RAnkle",    "LHip",   "LKnee",   "LAnkle",    "REye",   "LEye",   "REar",
                              "LEar", "LBigToe", "LSmallToe", "LHeel",  "RBigToe", "RSmallToe", "RHeel"},
                   {kNeckToHead, kMidHip, kArms, kLegs, kFace, kFeet}),
      MakeSkeleton("body25b",
                   {"Nose",   "LEye",    "REye",      "LEar",  "REar",    "LShoulder", "RShoulder", "LElbow", "RElbow",
                    "LWrist", "RWrist",  "LHip",      "RHip",  "LKnee",   "RKnee",     "LAnkle",    "RAnkle", "Neck",
                    "Head",   "LBigToe", "LSmallToe", "LHeel", "RBigToe", "RSmallToe", "RHeel"},
                   {kUpperNeck, kBox, kArms, kLegs, kFace, kFeet}),
      MakeSkeleton("coco17",
                   {"Nose", "LEye", "REye", "LEar", "REar", "LShoulder", "RShoulder", "LElbow", "RElbow", "LWrist", "RWrist",
                    "LHip", "RHip", "LKnee", "RKnee", "LAnkle", "RAnkle"},
                   {kBox, kArms, kLegs, kFace}),
      MakeSkeleton("coco18",
                   {"Nose", "Neck", "RShoulder", "RElbow", "RWrist", "LShoulder", "LElbow", "LWrist", "RHip", "RKnee", "RAnkle",
                    "LHip", "LKnee", "LAnkle", "REye", "LEye", "REar", "LEar"},
                   {kNeckToHead, kNeckToHips, kArms, kLegs, kFace}),
      MakeSkeleton("coco19",
                   {"Neck", "Nose", "MidHip", "LShoulder", "LElbow", "LWrist", "LHip", "LKnee", "LAnkle", "RShoulder", "RElbow",
                    "RWrist", "RHip", "RKnee", "RAnkle", "LEye", "LEar", "REye", "REar"},
                   {kNeckToHead, kMidHip, kArms, kLegs, kFace}),
  };
}

const std::vector<Skeleton>& All() {
  static const std::vector<Skeleton> all = MakeAll();
  return all;
}

}  // namespace

int Skeleton::Find(const std::string& joint) const {
  const auto it = std::find(joints.begin(), joints.end(), joint);
  return it == joints.end() ? -1 : static_cast<int>(it - joints.begin());
}

std::vector<std::string> SkeletonNames() {
  std::vector<std::string> names;
  for (const Skeleton& skeleton : All()) names.push_back(skeleton.name);
  return names;
}

const Skeleton& SkeletonByName(const std::string& name) {
  for (const Skeleton& skeleton : All()) {
    if (skeleton.name == name) return skeleton;
  }
  std::string known;
  for (const std::string& each : SkeletonNames()) known += (known.empty() ? "" : ", ") + each;
  throw UsageError("unknown skeleton \"" + name + "\"; known are " + known);
}

const Skeleton& Coco19() {
  static const Skeleton& coco19 = SkeletonByName("coco19");
  return coco19;
}

std::array<std::vector<int>, 19> Coco19From(const Skeleton& from) {
  // The Neck of a skeleton that also knows the top of the head lies above the shoulder line.
  const bool upper_neck = from.Find("Head") >= 0;
  const auto mean_of = [&from](const char* left, const char* right) {
    const int i = from.Find(left), j = from.Find(right);
    return i >= 0 && j >= 0 ? std::vector<int>{i, j} : std::vector<int>{};
  };
  std::array<std::vector<int>, 19> sources;
  for (size_t k = 0; k < sources.size(); ++k) {
    const std::string& joint = Coco19().joints[k];
    const int own = joint == "Neck" && upper_neck ? -1 : from.Find(joint);
    if (own >= 0) {
      sources[k] = {own};
    } else if (joint == "Neck") {
      sources[k] = mean_of("LShoulder", "RShoulder");
    } else if (joint == "MidHip") {
      sources[k] = mean_of("LHip", "RHip");
    }
  }
  return sources;
}

}  // namespace mvstudio::body
