#include <Eigen/Geometry>

#include "calib/board/pixel_origin.h"
#include "core/error.h"
#include "dataset/exports/writers.h"

/// ActorsHQ as HumanRF reads it: SCALE/calibration.csv (camera to world: rotation vector and centre; focal lengths and
/// principal point as shares of the image, counted from its corner), SCALE/rgbs, SCALE/masks, and aabbs.csv one level up.
namespace mvstudio::exports {
namespace {

std::string CalibrationCsv(const Take& take) {
  std::string text = "name,w,h,rx,ry,rz,tx,ty,tz,fx,fy,px,py\n";
  for (const View& view : take.views) {
    const geometry::Camera& lens = view.camera.camera;
    const geometry::Rigid3 world_from_cam = Inverse(view.camera.cam_from_world);
    const Eigen::Vector3d axis = geometry::RotationLog(world_from_cam.rotation);
    text += view.info.name + "," + std::to_string(lens.width_px) + "," + std::to_string(lens.height_px);
    for (int k = 0; k < 3; ++k) text += "," + Num(axis[k]);
    for (int k = 0; k < 3; ++k) text += "," + Num(world_from_cam.translation[k]);
    const double shift = calib::kCornerOriginShiftPx;
    text += "," + Num(lens.fx() / lens.width_px) + "," + Num(lens.fy() / lens.height_px) + "," +
            Num((lens.cx() + shift) / lens.width_px) + "," + Num((lens.cy() + shift) / lens.height_px) + "\n";
  }
  return text;
}

/// The joints' box with room for the flesh and clothes around them.
std::string AabbsCsv(const Take& take, int* empty) {
  constexpr double kMarginM = 0.3;
  std::string text = "frame_number,aabb_min_x,aabb_min_y,aabb_min_z,aabb_max_x,aabb_max_y,aabb_max_z\n";
  for (const int frame : take.frames) {
    Eigen::AlignedBox3d box;
    for (const auto& [id, pose] : take.At(frame)) {
      for (int j = 0; j < 19; ++j) {
        if (pose.valid[j]) box.extend(Eigen::Vector3d(pose.x_in_world.col(j)));
      }
    }
    if (box.isEmpty()) {
      ++*empty;
      continue;
    }
    text += std::to_string(frame);
    for (int k = 0; k < 3; ++k) text += "," + Num(box.min()[k] - kMarginM);
    for (int k = 0; k < 3; ++k) text += "," + Num(box.max()[k] + kMarginM);
    text += "\n";
  }
  return text;
}

}  // namespace

void WriteActorsHq(const Job& job) {
  const Take& take = job.take;
  const std::string scale = SafeNames({job.options.scale_folder})[0];
  if (scale != job.options.scale_folder) throw UsageError("option 'scale-folder': letters, digits, _ and - only, e.g. 4x");
  job.Write(scale + "/calibration.csv", CalibrationCsv(take));
  if (take.frames.empty()) return;
  int empty = 0;
  job.Write("aabbs.csv", AabbsCsv(take, &empty));
  if (empty > 0) {
    job.report->notes.push_back({"EXP-EMPTY-FRAME", std::to_string(empty) + " frames without joints have no line in aabbs.csv",
                                 "choose frames with people by option 'frames'"});
  }
  for (const int frame : take.frames) {
    for (size_t i = 0; i < take.views.size(); ++i) {
      const std::string& name = take.views[i].info.name;
      job.images.AddImage(i, frame, scale + "/rgbs/" + name + "/" + Numbered(name + "_rgb", frame, 6, ""), ".jpg");
      job.images.AddMask(i, frame, scale + "/masks/" + name + "/" + Numbered(name + "_mask", frame, 6, ".png"));
    }
  }
}

}  // namespace mvstudio::exports
