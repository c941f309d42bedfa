#include "dataset/markers/bvh.h"

#include <cctype>
#include <cmath>
#include <set>

#include "core/text/shortest_text.h"
#include "core/units.h"

namespace mvstudio::markers {
namespace {

constexpr double kCmPerM = 100;

/// The joints' names without blanks, each once.
std::vector<std::string> BvhNames(const std::vector<std::string>& joints) {
  std::set<std::string> taken;
  std::vector<std::string> names;
  for (std::string name : joints) {
    for (char& c : name) {
      const auto byte = static_cast<unsigned char>(c);
      if (byte <= ' ' || c == '{' || c == '}') c = '_';
    }
    while (!taken.insert(name).second) name += '_';
    names.push_back(name);
  }
  return names;
}

std::string OffsetLine(const Eigen::Vector3d& metres) {
  std::string text = "OFFSET";
  for (int k = 0; k < 3; ++k) text += " " + ShortestText(kCmPerM * metres[k]);
  return text + "\n";
}

/// The nodes of the file: a node and what hangs from it. `order` receives the nodes as their channels stand in the file.
class HierarchyText {
 public:
  HierarchyText(const BvhMotion& motion, const std::vector<std::string>& joints) : motion_(motion), names_(BvhNames(joints)) {}

  std::string Of(int index, const std::string& indent, std::vector<int>* order) const {
    const BvhNode& node = motion_.nodes[static_cast<size_t>(index)];
    const bool root = node.parent < 0;
    order->push_back(index);
    std::string text = indent + (root ? "ROOT " : "JOINT ") + names_[static_cast<size_t>(node.joint)] + "\n" + indent + "{\n" +
                       indent + "  " + OffsetLine(node.offset) + indent + "  " +
                       (root ? "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n"
                             : "CHANNELS 3 Zrotation Xrotation Yrotation\n");
    for (const int child : node.children) text += Of(child, indent + "  ", order);
    if (node.children.empty()) text += End(node, indent + "  ");
    return text + indent + "}\n";
  }

 private:
  static std::string End(const BvhNode& node, const std::string& indent) {
    constexpr double kEndShare = 0.25;  // hands, feet and ears reach on beyond their joint
    return indent + "End Site\n" + indent + "{\n" + indent + "  " + OffsetLine(kEndShare * node.offset) + indent + "}\n";
  }

  const BvhMotion& motion_;
  std::vector<std::string> names_;
};

}  // namespace

Eigen::Vector3d ZxyAngles(const Eigen::Matrix3d& r) {
  const double cos_b = std::hypot(r(2, 0), r(2, 2));
  const double b = std::atan2(r(2, 1), cos_b);
  constexpr double kLocked = 1e-12;
  if (cos_b < kLocked) return {std::atan2(r(1, 0), r(0, 0)), b, 0};
  return {std::atan2(-r(0, 1), r(1, 1)), b, std::atan2(-r(2, 0), r(2, 2))};
}

std::string BvhText(const BvhMotion& motion, const geometry::Skeleton& skeleton, double rate_hz) {
  std::vector<int> order;
  std::string text = "HIERARCHY\n" + HierarchyText(motion, skeleton.joints).Of(0, "", &order) +
                     "MOTION\nFrames: " + std::to_string(motion.frames.size()) + "\nFrame Time: " + ShortestText(1 / rate_hz) +
                     "\n";
  for (const BvhFrame& frame : motion.frames) {
    const Eigen::Vector3d root = kCmPerM * frame.root;
    text += ShortestText(root.x()) + " " + ShortestText(root.y()) + " " + ShortestText(root.z());
    for (const int index : order) {
      const Eigen::Vector3d angles = ZxyAngles(frame.local_rotation[static_cast<size_t>(index)].toRotationMatrix());
      for (int k = 0; k < 3; ++k) text += " " + ShortestText(RadToDeg(angles[k]));
    }
    text += "\n";
  }
  return text;
}

}  // namespace mvstudio::markers
