#include "report/figures.h"

#include <cmath>

namespace mvstudio::report {
namespace {

constexpr Better kLess = Better::kLess, kMore = Better::kMore, kNeither = Better::kNeither;
constexpr double kSigmasOf95 = 1.959964;  // of a normal distribution, to each side

Figure OnCard(Figure figure) {
  figure.on_card = true;
  return figure;
}

Figure Main(Figure figure) {
  figure.main = true;
  return figure;
}

/// A score of held-out images.
Figure HeldOutScore(const char* label, const char* key, const char* unit, Better better, const char* list = "") {
  Figure figure{"avatar eval", list, label, {key}, unit, better};
  figure.of_held_out = true;
  return figure;
}

void AddOfCameras(std::vector<Figure>* figures) {
  *figures = {
      OnCard({"calibrate", "", "rms", {"rms_px"}, "px", kLess}),
      Main(OnCard({"calibrate", "", "held-out rms", {"holdout_rms_px"}, "px", kLess})),
      OnCard({"calibrate", "", "baseline", {"baseline_mm"}, "mm", kNeither}),
      {"calibrate", "", "uncertainty at the image's centre", {"uncertainty.centre_px"}, "px", kLess},
      {"calibrate", "", "uncertainty at the image's edge", {"uncertainty.edge_px"}, "px", kLess},
      {"calibrate", "", "uncertainty where the boards were", {"uncertainty.volume_mm"}, "mm", kLess},
      {"calibrate", "", "board edges, rms", {"board_edge_mm.rms"}, "mm", kLess},
      {"calibrate", "", "corners", {"num_corners"}, "", kNeither},
      {"calibrate", "cameras", "held-out rms", {"holdout_rms_px"}, "px", kLess},
      {"calibrate", "cameras", "rms", {"rms_px"}, "px", kLess},
      {"calibrate", "cameras", "image covered by corners", {"coverage"}, "%", kMore, 100},
      {"calibrate", "cameras", "focal length", {"focal_px"}, "px", kNeither, 1, "focal_sigma_px"},
      Main({"calib eval", "", "rms of new boards", {"rms_px"}, "px", kLess}),
      {"calib eval", "cameras", "rms of new boards", {"rms_px"}, "px", kLess},
      Main({"sync", "", "median residual", {"median_residual_px.after"}, "px", kLess}),
      {"sync", "cameras", "time offset", {"offset_frames"}, "frames", kNeither, 1, "sigma_frames"},
  };
}

void AddOfPeople(std::vector<Figure>* figures) {
  const std::vector<Figure> more = {
      Main(OnCard({"pose2d", "", "camera left out", {"agreement.median_px"}, "px", kLess, 1, "agreement.median_error_px"})),
      {"pose2d", "", "joints that agree", {"agreement.share_ok"}, "%", kMore, 100},
      Main({"triangulate", "", "camera left out, median", {"holdout.median_px"}, "px", kLess, 1, "holdout.median_error_px"}),
      OnCard({"triangulate", "", "median rms", {"median_rms_px"}, "px", kLess}),
      OnCard({"triangulate", "", "median \u03c3", {"median_sigma_mm"}, "mm", kLess}),
      OnCard(
          {"triangulate", "", "off the reference", {"truth.median_mm", "reference.median_mm", "trc.median_mm"}, "mm", kLess}),
      OnCard({"triangulate", "", "joints", {"num_points"}, "", kNeither}),
      {"triangulate", "", "limb lengths vary by", {"limb_std_mm"}, "mm", kLess},
      {"triangulate", "holdout.cameras", "left out, median", {"median_px"}, "px", kLess, 1, "median_error_px"},
      OnCard({"mask", "", "images", {"pictures"}, "", kNeither}),
      Main(OnCard({"mask", "", "pixels that flicker", {"flicker"}, "%", kLess, 100})),
      {"mask", "", "disagreement with the visual hull", {"disagreement_with_hull"}, "%", kLess, 100},
      {"mask", "", "IoU with exact masks", {"truth.mean_iou"}, "", kMore},
      {"dataset build", "", "images", {"pictures"}, "", kNeither},
      {"dataset verify", "", "errors", {"num_errors"}, "", kLess},
      Main({"error-budget", "", "error on left-out cameras", {"held_out_rms_px"}, "px", kLess}),
  };
  figures->insert(figures->end(), more.begin(), more.end());
}

void AddOfAvatars(std::vector<Figure>* figures) {
  const std::vector<Figure> more = {
      Main({"avatar fit", "", "IoU of held-out silhouettes", {"held_out_iou"}, "", kMore}),
      {"avatar fit", "", "joints off the body", {"joint_error_mm"}, "mm", kLess},
      {"avatar fit", "", "surface \u03c3, median", {"surface_sigma_mm.median"}, "mm", kLess},
      Main(OnCard(HeldOutScore("SSIM", "holdout.ssim", "", kMore))),
      Main(OnCard(HeldOutScore("PSNR", "holdout.psnr_db", "dB", kMore))),
      Main(OnCard(HeldOutScore("mask IoU", "holdout.mask_iou", "", kMore))),
      HeldOutScore("outlines F", "holdout.boundary_f", "", kMore),
      HeldOutScore("LPIPS", "holdout.lpips", "", kLess),
      HeldOutScore("Fr\u00e9chet distance", "holdout.fd.value", "", kLess),
      HeldOutScore("flicker", "holdout.flicker", "", kLess),
      HeldOutScore("SSIM", "ssim", "", kMore, "per_camera"),
      HeldOutScore("PSNR", "psnr_db", "dB", kMore, "per_camera"),
      HeldOutScore("mask IoU", "mask_iou", "", kMore, "per_camera"),
      {"avatar eval", "", "time an image", {"seconds_per_frame"}, "ms", kLess, 1000, "", false, false, false, true},
      OnCard({"demo", "", "rig rotation", {"truth.rig_rotation_deg"}, "\u00b0", kLess}),
      OnCard({"demo", "", "rig position", {"truth.rig_translation_mm"}, "mm", kLess}),
      OnCard({"demo", "", "joints, median", {"truth.joints_median_mm"}, "mm", kLess}),
  };
  figures->insert(figures->end(), more.begin(), more.end());
}

/// "holdout.ssim" -> "holdout.ssim_ci95", a pair.
double HalfInterval(const Value& of, const std::string& key) {
  const Value& ends = of.Path(key + "_ci95");
  return (ends.At(1).Number() - ends.At(0).Number()) / 2;
}

}  // namespace

const std::vector<Figure>& Figures() {
  static const std::vector<Figure> figures = [] {
    std::vector<Figure> list;
    AddOfCameras(&list), AddOfPeople(&list), AddOfAvatars(&list);
    return list;
  }();
  return figures;
}

double FigureNumber(const Figure& figure, const Value& of) { return figure.scale * of.FirstNumber(figure.keys); }

double FigureHalfWidth(const Figure& figure, const Value& of) {
  const double sigma = *figure.sigma ? of.Path(figure.sigma).Number() : std::nan("");
  if (sigma > 0) return figure.scale * kSigmasOf95 * sigma;
  return figure.scale * HalfInterval(of, figure.keys.front());
}

}  // namespace mvstudio::report
