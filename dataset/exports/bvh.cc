#include "dataset/markers/bvh.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/format.h"
#include "dataset/exports/joint_files.h"
#include "geometry/skeleton/skeleton.h"

namespace mvstudio::exports {
namespace {

/// The 19 joints of people whose own skeleton says nothing of its rest: programs know them, and their T-pose.
Take ForBvh(const Take& take) {
  Take chosen = take;
  if (take.own && take.own->skeleton.human && take.own->skeleton.rest_m.empty()) chosen.own.reset();
  return chosen;
}

}  // namespace

void WriteBvh(const Job& job) {
  RequirePeople(job);
  const Take take = ForBvh(job.take);
  const geometry::Skeleton& skeleton = SkeletonOf(take);
  if (skeleton.bones.empty()) {
    throw FormatError(take.root, "hdPose3d_stage1_" + skeleton.name,
                      "has joints without bones, of which no hierarchy can be made; build the dataset with option 'skeleton'");
  }
  double squares = 0, largest = 0;
  int joints = 0, held = 0;
  for (const int person : take.PersonIds()) {
    const markers::BvhMotion motion = FitBvh(MarkersOf(take, person), skeleton);
    job.Write(PersonFile(take, person, ".bvh"), BvhText(motion, skeleton, take.frame_rate_hz));
    squares += motion.rms_m * motion.rms_m * motion.num_joints, joints += motion.num_joints;
    largest = std::max(largest, motion.max_m), held += motion.num_held;
  }
  const double rms_mm = 1000 * std::sqrt(squares / std::max(joints, 1));
  job.report->figures.emplace_back("bvh_rms_mm", rms_mm);
  job.report->figures.emplace_back("bvh_max_mm", 1000 * largest);
  job.report->figures.emplace_back("bvh_held_frames", held);
  const std::string text =
      Format("bones of one length cannot follow the joints exactly: %.1f mm RMS, %.1f mm at worst", rms_mm, 1000 * largest);
  job.report->notes.push_back({"EXP-BVH-FIT", text, "trc, csv and npz hold the joints themselves"});
  if (!take.own) NoteJointsBeside(job);
}

}  // namespace mvstudio::exports
