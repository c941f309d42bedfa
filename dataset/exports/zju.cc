#include "core/error.h"
#include "dataset/exports/pickle.h"
#include "dataset/exports/writers.h"

/// ZJU-MoCap as Neural Body reads it: annots.npy with the cameras (T in millimetres, world to camera) and, for every frame, the
/// images of all cameras; masks below mask/ and mask_cihp/ under the image's path: Neural Body opens the latter, HumanNeRF
/// both.
namespace mvstudio::exports {
namespace {

PyValue CamerasOf(const Take& take) {
  std::vector<PyValue> k, d, r, t;
  for (const View& view : take.views) {
    const geometry::Camera& lens = view.camera.camera;
    const auto distortion = *Brown5Of(lens);
    const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rotation = view.camera.cam_from_world.rotation.toRotationMatrix();
    const Eigen::Vector3d translation_mm = 1000 * view.camera.cam_from_world.translation;
    k.push_back(PyValue::Array({3, 3}, MatrixOf(lens)));
    d.push_back(PyValue::Array({5, 1}, std::vector<double>(distortion.data(), distortion.data() + 5)));
    r.push_back(PyValue::Array({3, 3}, std::vector<double>(rotation.data(), rotation.data() + 9)));
    t.push_back(PyValue::Array({3, 1}, std::vector<double>(translation_mm.data(), translation_mm.data() + 3)));
  }
  return PyValue::Dict({{"K", PyValue::List(k)}, {"D", PyValue::List(d)}, {"R", PyValue::List(r)}, {"T", PyValue::List(t)}});
}

/// Neural Body brings the images to cfg.W x cfg.H before it applies K, and leaves the masks as they are.
void NoteSizes(const Job& job) {
  constexpr int kUsualPx = 1024;
  const geometry::Camera& first = job.take.views[0].camera.camera;
  bool same = true;
  for (const View& view : job.take.views)
    same &= view.camera.camera.width_px == first.width_px && view.camera.camera.height_px == first.height_px;
  if (same && first.width_px == kUsualPx && first.height_px == kUsualPx) return;
  const std::string size = "H: " + std::to_string(first.height_px) + ", W: " + std::to_string(first.width_px);
  job.report->notes.push_back(
      {"EXP-SIZE",
       same ? "Neural Body takes images to be 1024x1024 unless its configuration says otherwise; these need " + size
            : "Neural Body takes images of one size, H x W of its configuration; these cameras have several",
       same ? "write " + size + " into the configuration" : "choose cameras of one size with option 'cameras'"});
}

}  // namespace

void WriteZju(const Job& job) {
  std::vector<PyValue> frames;
  for (const int frame : job.take.frames) {
    std::vector<PyValue> paths;
    for (size_t i = 0; i < job.take.views.size(); ++i) {
      const std::string stem = Numbered(job.take.views[i].info.name + "/", frame, 6, "");
      std::string file = job.images.AddImage(i, frame, stem);
      if (file.empty()) file = stem + ".jpg";
      paths.push_back(PyValue::Text(file));
      if (job.images.AddMask(i, frame, "mask/" + stem + ".png")) job.images.AlsoTo("mask_cihp/" + stem + ".png");
    }
    frames.push_back(PyValue::Dict({{"ims", PyValue::List(paths)}}));
  }
  job.Write("annots.npy", PyValue::Dict({{"cams", CamerasOf(job.take)}, {"ims", PyValue::List(frames)}}).ToNpy());
  if (!job.take.frames.empty()) {
    NoteSizes(job);
    job.report->notes.push_back({"EXP-NO-SMPL", "new_params/ and new_vertices/ (SMPL fits) are not written: there are none",
                                 "fit SMPL with EasyMocap on the easymocap export"});
  }
}

}  // namespace mvstudio::exports
