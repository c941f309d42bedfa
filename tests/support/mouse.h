#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <string>
#include <vector>

/// A mouse of 15 joints and 14 bones of one length each, as large as a dog so that the cameras of a room see it.
namespace mvstudio::testing {

struct MouseJoint {
  const char* name;
  int parent;           ///< index; parents come first
  double x, y, z;       ///< from the parent at rest, metres, z up, the nose towards x
  double swing, phase;  ///< about the joint's own y, radians
};

inline const std::vector<MouseJoint>& Mouse() {
  static const std::vector<MouseJoint> mouse = {{"back", -1, 0, 0, 0, 0.1, 0},
                                                {"neck", 0, 0.25, 0, 0.05, 0.3, 1},
                                                {"nose", 1, 0.15, 0, 0.02, 0, 0},
                                                {"left_ear", 1, 0.05, 0.06, 0.08, 0, 0},
                                                {"right_ear", 1, 0.05, -0.06, 0.08, 0, 0},
                                                {"left_forepaw", 1, 0.02, 0.08, -0.2, 0, 0},
                                                {"right_forepaw", 1, 0.02, -0.08, -0.2, 0, 0},
                                                {"rump", 0, -0.25, 0, 0, 0.2, 2},
                                                {"left_knee", 7, 0.05, 0.1, -0.12, 0.4, 0},
                                                {"right_knee", 7, 0.05, -0.1, -0.12, 0.4, 3},
                                                {"left_hindpaw", 8, -0.04, 0.01, -0.12, 0, 0},
                                                {"right_hindpaw", 9, -0.04, -0.01, -0.12, 0, 0},
                                                {"tail_base", 7, -0.1, 0, 0, 0.3, 1},
                                                {"tail_mid", 12, -0.2, 0, 0, 0.4, 2},
                                                {"tail_tip", 13, -0.2, 0, 0.02, 0, 0}};
  return mouse;
}

inline std::vector<std::string> MouseNames() {
  std::vector<std::string> names;
  for (const MouseJoint& joint : Mouse()) names.push_back(joint.name);
  return names;
}

/// Its joints in world, walking along x: turned joint by joint, so that a BVH can follow exactly.
inline std::vector<Eigen::Vector3d> MouseAt(double frame) {
  std::vector<Eigen::Matrix3d> axes;
  std::vector<Eigen::Vector3d> x;
  for (const MouseJoint& joint : Mouse()) {
    const Eigen::AngleAxisd turn(joint.swing * std::sin(0.15 * frame + joint.phase), Eigen::Vector3d::UnitY());
    if (joint.parent < 0) {
      axes.push_back(Eigen::AngleAxisd(0.02 * frame, Eigen::Vector3d::UnitZ()) * turn.toRotationMatrix());
      x.emplace_back(-0.3 + 0.01 * frame, 0.1, 0.05);
      continue;
    }
    const size_t parent = static_cast<size_t>(joint.parent);
    x.push_back(x[parent] + axes[parent] * Eigen::Vector3d(joint.x, joint.y, joint.z));
    axes.push_back(axes[parent] * turn.toRotationMatrix());
  }
  return x;
}

/// The skeleton's file; `tail_m`: what the middle of the tail may measure.
inline std::string MouseToml(const std::string& tail_m = "[0.18, 0.22]") {
  std::string joints, bones;
  for (const MouseJoint& joint : Mouse()) {
    const std::string name = std::string("\"") + joint.name + "\"";
    joints += name + ", ";
    if (joint.parent < 0) continue;
    const std::string ends = "[\"" + std::string(Mouse()[static_cast<size_t>(joint.parent)].name) + "\", " + name + "]";
    const bool tail = std::string(joint.name) == "tail_mid";
    bones += tail ? "{ joints = " + ends + ", length_m = " + tail_m + ", colour = \"#ff8800\" }, " : ends + ", ";
  }
  return "name = \"mouse\"\njoints = [" + joints + "]\nbones = [" + bones +
         "]\nroot = \"back\"\nup = { from = [\"left_forepaw\", \"right_forepaw\"], to = [\"neck\"] }\n"
         "pairs = [[\"left_ear\", \"right_ear\"], [\"left_forepaw\", \"right_forepaw\"],\n"
         "         [\"left_knee\", \"right_knee\"], [\"left_hindpaw\", \"right_hindpaw\"]]\n";
}

}  // namespace mvstudio::testing
