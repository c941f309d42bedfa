#include <nlohmann/json.hpp>

#include "calib/board/pixel_origin.h"
#include "dataset/exports/writers.h"
#include "dataset/footage/image_io.h"

/// transforms.json, https://docs.nerf.studio/quickstart/data_conventions.html: camera axes are OpenGL's (x right, y up, z
/// backward), transform_matrix is world_from_cam, pixels count from the corner of the image.
namespace mvstudio::exports {
namespace {

using Json = nlohmann::ordered_json;

Json RowsJson(const Eigen::Matrix4d& matrix, int rows) {
  Json json = Json::array();
  for (int r = 0; r < rows; ++r) json.push_back({matrix(r, 0), matrix(r, 1), matrix(r, 2), matrix(r, 3)});
  return json;
}

Json FrameJson(const View& view, const std::string& image, const std::string& mask) {
  const geometry::Camera& lens = view.camera.camera;
  const auto k = *Brown5Of(lens);
  Eigen::Matrix4d world_from_cam = ToMatrix(Inverse(view.camera.cam_from_world));
  world_from_cam.block<4, 2>(0, 1) *= -1;  // y up, z backward
  return {{"file_path", image},
          {"w", lens.width_px},
          {"h", lens.height_px},
          {"fl_x", lens.fx()},
          {"fl_y", lens.fy()},
          {"cx", lens.cx() + calib::kCornerOriginShiftPx},
          {"cy", lens.cy() + calib::kCornerOriginShiftPx},
          {"k1", k[0]},
          {"k2", k[1]},
          {"p1", k[2]},
          {"p2", k[3]},
          {"transform_matrix", RowsJson(world_from_cam, 4)},
          {"mask_path", mask}};
}

/// nerfstudio asks for a mask of every image or of none: images without one get one that ignores nothing.
void CompleteMasks(const Job& job, const std::vector<size_t>& without_mask, const std::string& prefix, Json* frames) {
  if (without_mask.size() == frames->size()) {
    for (Json& frame : *frames) frame.erase("mask_path");
    return;
  }
  for (const size_t i : without_mask) {
    const geometry::Camera& lens = job.take.views[i].camera.camera;
    const Image all(lens.width_px, lens.height_px, 1, 255);
    job.Write(prefix + "masks/" + job.take.views[i].info.name + ".png", dataset::EncodeImage(all, "mask.png"));
  }
}

void WriteTimeStep(const Job& job, int frame, const std::string& prefix) {
  Json json = {{"camera_model", "OPENCV"},
               {"orientation_override", "none"},
               {"applied_transform", RowsJson(Eigen::Matrix4d::Identity(), 3)}};
  std::map<dataset::PartOfSplit, Json> parts;
  Json frames = Json::array();
  std::vector<size_t> without_mask;
  for (size_t i = 0; i < job.take.views.size(); ++i) {
    const View& view = job.take.views[i];
    const std::string file = job.images.AddImage(i, frame, prefix + "images/" + view.info.name);
    const std::string mask = "masks/" + view.info.name + ".png";
    const bool has_mask = job.images.AddMask(i, frame, prefix + mask);
    if (file.empty() && job.options.images != ExportImages::kNone) continue;
    if (!has_mask) without_mask.push_back(i);
    const std::string image = file.empty() ? "images/" + view.info.name + ".jpg" : file.substr(prefix.size());
    frames.push_back(FrameJson(view, image, mask));
    parts[view.info.part].push_back(image);
  }
  CompleteMasks(job, without_mask, prefix, &frames);
  const std::vector<StartPoint> points = StartPoints(job, frame);
  if (!points.empty()) {
    job.Write(prefix + "points3d.ply", PlyBinary({points.begin(), points.end()}));
    json["ply_file_path"] = "points3d.ply";
  }
  if (job.take.split) {
    json["train_filenames"] = parts[dataset::PartOfSplit::kTrain];
    // nerfstudio asks for a validation set whenever one part is named.
    json["val_filenames"] = parts[dataset::PartOfSplit::kValidation].empty() ? parts[dataset::PartOfSplit::kTest]
                                                                             : parts[dataset::PartOfSplit::kValidation];
    json["test_filenames"] = parts[dataset::PartOfSplit::kTest];
    for (const char* key : {"train_filenames", "val_filenames", "test_filenames"}) {
      if (json[key].is_null()) json[key] = Json::array();
    }
  }
  json["frames"] = frames;
  job.Write(prefix + "transforms.json", json.dump(1) + "\n");
}

}  // namespace

void WriteNerfstudio(const Job& job) {
  for (const int frame : job.take.frames) {
    WriteTimeStep(job, frame, job.take.frames.size() > 1 ? Numbered("frame_", frame, 8, "/") : "");
  }
}

}  // namespace mvstudio::exports
