#include "exports/bvh.h"

#include <cmath>

#include "body/skeleton.h"
#include "core/format.h"
#include "core/units.h"
#include "exports/joint_files.h"

/// Biovision hierarchy: y up, centimetres, degrees, channels Zrotation Xrotation Yrotation.
namespace mvstudio::exports {
namespace {

constexpr double kCmPerM = 100;

std::string OffsetText(const Eigen::Vector3d& metres) {
  return "OFFSET " + Num(kCmPerM * metres.x()) + " " + Num(kCmPerM * metres.y()) + " " + Num(kCmPerM * metres.z()) + "\n";
}

/// A node and what hangs from it; `order` receives the nodes as their channels stand in the file.
std::string NodeText(const BvhMotion& motion, int index, const std::string& indent, std::vector<int>* order) {
  const BvhNode& node = motion.nodes[static_cast<size_t>(index)];
  const bool root = node.parent < 0;
  order->push_back(index);
  std::string text = indent + (root ? "ROOT " : "JOINT ") + body::Coco19().joints[static_cast<size_t>(node.joint)] + "\n" +
                     indent + "{\n" + indent + "  " + OffsetText(node.offset) + indent + "  " +
                     (root ? "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n"
                           : "CHANNELS 3 Zrotation Xrotation Yrotation\n");
  for (const int child : node.children) text += NodeText(motion, child, indent + "  ", order);
  if (node.children.empty()) {
    constexpr double kEndShare = 0.25;  // hands, feet and ears reach on beyond their joint
    text +=
        indent + "  End Site\n" + indent + "  {\n" + indent + "    " + OffsetText(kEndShare * node.offset) + indent + "  }\n";
  }
  return text + indent + "}\n";
}

std::string BvhText(const BvhMotion& motion, double rate_hz) {
  std::vector<int> order;
  std::string text = "HIERARCHY\n" + NodeText(motion, 0, "", &order) +
                     "MOTION\nFrames: " + std::to_string(motion.frames.size()) + "\nFrame Time: " + Num(1 / rate_hz) + "\n";
  for (const BvhFrame& frame : motion.frames) {
    const Eigen::Vector3d root = kCmPerM * frame.root;
    text += Num(root.x()) + " " + Num(root.y()) + " " + Num(root.z());
    for (const int index : order) {
      const Eigen::Vector3d angles = ZxyAngles(frame.local_rotation[static_cast<size_t>(index)].toRotationMatrix());
      for (int k = 0; k < 3; ++k) text += " " + Num(RadToDeg(angles[k]));
    }
    text += "\n";
  }
  return text;
}

}  // namespace

void WriteBvh(const Job& job) {
  RequirePeople(job);
  const std::vector<int> frames = ContinuousFrames(job.take);
  double squares = 0, largest = 0;
  int joints = 0, held = 0;
  for (const int person : job.take.PersonIds()) {
    std::vector<const dataset::Coco19Pose*> poses;
    for (const int frame : frames) poses.push_back(PoseOf(job.take, frame, person));
    const BvhMotion motion = FitBvh(poses);
    job.Write(PersonFile(job.take, person, ".bvh"), BvhText(motion, job.take.frame_rate_hz));
    squares += motion.rms_m * motion.rms_m * motion.num_joints, joints += motion.num_joints;
    largest = std::max(largest, motion.max_m);
    for (const BvhFrame& frame : motion.frames) held += frame.held;
  }
  job.report->figures.emplace_back("bvh_rms_mm", 1000 * std::sqrt(squares / std::max(joints, 1)));
  job.report->figures.emplace_back("bvh_max_mm", 1000 * largest);
  job.report->figures.emplace_back("bvh_held_frames", held);
  const std::string text = Format("bones of one length cannot follow the joints exactly: %.1f mm RMS, %.1f mm at worst",
                                  1000 * std::sqrt(squares / std::max(joints, 1)), 1000 * largest);
  job.report->notes.push_back({"EXP-BVH-FIT", text, "trc, csv and npz hold the joints themselves"});
}

}  // namespace mvstudio::exports
