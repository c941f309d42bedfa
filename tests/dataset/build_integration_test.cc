#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/hash/sha256.h"
#include "dataset/build/build.h"
#include "dataset/footage/image_io.h"
#include "dataset/footage/video_io.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/verify/verify.h"
#include "geometry/rig/rig_io.h"
#include "geometry/skeleton/skeleton.h"
#include "tests/dataset/dataset_test_util.h"

namespace mvstudio::dataset {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int kFrames = 12;

/// A take of three cameras made from every tenth frame of person_a: a calibration of ours, videos, 3D joints.
class BuildTest : public ::testing::Test {
 protected:
  void SetUp() override {
    MVS_NEEDS_DATA("person_a");
    person_ = OpenPanopticDataset(DataFolder("person_a"));
    inputs_.calibration = folder_ / "calibration.json";
    inputs_.pose3d = folder_ / "pose3d";
    geometry::Rig rig;
    for (int c = 0; c < 3; ++c) {
      rig.cameras.push_back(person_.rig.cameras[c]);
      rig.cameras.back().camera.name = Alias(c);
    }
    geometry::WriteRig(rig, inputs_.calibration);
    WritePoses();
    for (int c = 0; c < 3; ++c) {
      WriteVideo(c, 0);
      inputs_.footage.push_back({Alias(c), Video(c), ""});
    }
    options_.sequence = "t";
  }

  static std::string Alias(int c) { return "cam_" + std::string(1, static_cast<char>('a' + c)); }
  std::string Video(int c) const { return folder_ / (Alias(c) + ".mp4"); }
  std::string Name(int c) const { return person_.rig.cameras[c].camera.name; }
  Image TruthImage(int c, int frame) const { return ReadImage(person_.ImagePath(Name(c), 10 * frame)); }

  void WritePoses(const Eigen::Vector3d& moved = Eigen::Vector3d::Zero()) const {
    Pose3d pose;
    pose.skeleton = "coco19";
    for (int f = 0; f < kFrames; ++f) {
      const Coco19Pose& joints = person_.poses.at(10 * f).at(0);
      for (int j = 0; j < 19; ++j) {
        JointRow row;
        row.frame = f;
        row.joint = geometry::Coco19().joints[j];
        row.status = Status::kOk;
        row.x_in_world = joints.x_in_world.col(j) + moved;
        row.num_views = 3;
        row.sigma_m = 0.001;
        pose.rows.push_back(row);
      }
    }
    WritePose3d(pose, inputs_.pose3d);
  }

  /// Leaves out `cut_px` columns at the right.
  void WriteVideo(int c, int cut_px) const {
    VideoWriter writer(Video(c), 384 - cut_px, 384, 15, 4, true);
    for (int f = 0; f < kFrames; ++f) {
      const Image whole = TruthImage(c, f);
      Image part(384 - cut_px, 384, 3);
      for (int y = 0; y < 384; ++y) std::copy_n(whole.Pixel(0, y), 3 * part.width, part.Pixel(0, y));
      writer.Write(part);
    }
    writer.Close();
  }

  /// The error's text; the output must not be there, nor anything half-written.
  template <class Error>
  std::string FailedBuild() const {
    std::string text;
    try {
      BuildDataset(inputs_, folder_ / "out/dataset", options_);
      ADD_FAILURE() << "no error";
    } catch (const Error& error) {
      text = error.what();
    }
    EXPECT_TRUE(!fs::exists(folder_ / "out") || fs::is_empty(folder_ / "out"));
    return text;
  }

  mvstudio::testing::TempDir folder_;
  PanopticDataset person_;
  BuildInputs inputs_;
  BuildOptions options_;
};

TEST_F(BuildTest, VideosBecomeASoundDataset) {
  const BuildReport report = BuildDataset(inputs_, folder_ / "dataset", options_);
  EXPECT_EQ(report.frames, kFrames);
  EXPECT_EQ(report.images, 3 * kFrames);
  EXPECT_TRUE(report.warnings.empty());
  for (const Finding& f : VerifyDataset(folder_ / "dataset").findings)
    ADD_FAILURE() << f.code << " " << f.path << ": " << f.text;

  const PanopticDataset built = OpenPanopticDataset(folder_ / "dataset");
  EXPECT_EQ(built.Resolve("cam_b"), "00_01");
  double iou = 0;
  for (int c = 0; c < 3; ++c) {
    EXPECT_EQ(built.rig.cameras[c].camera.params, person_.rig.cameras[c].camera.params);
    for (int f = 0; f < kFrames; ++f) {
      EXPECT_LT(MeanAbsDifference(ReadImage(built.ImagePath("00_0" + std::to_string(c), f)), TruthImage(c, f)), 3.0);
      const Image mask = ReadImage(built.MaskPath("00_0" + std::to_string(c), f), true);
      const Image truth = ReadImage(person_.MaskPath(Name(c), 10 * f), true);
      double both = 0, either = 0;
      for (size_t p = 0; p < mask.pixels.size(); ++p)
        both += mask.pixels[p] && truth.pixels[p], either += mask.pixels[p] || truth.pixels[p];
      iou += both / either / (3 * kFrames);
    }
  }
  EXPECT_GT(iou, 0.95);
  const Eigen::Vector3d joint = built.poses.at(3).at(0).x_in_world.col(5);
  EXPECT_LT((joint - person_.poses.at(30).at(0).x_in_world.col(5)).norm(), 1e-9);
}

TEST_F(BuildTest, ExchangedVideosAreNamed) {
  std::swap(inputs_.footage[0].path, inputs_.footage[2].path);
  const BuildReport report = BuildDataset(inputs_, folder_ / "dataset", options_);
  ASSERT_FALSE(report.warnings.empty());
  EXPECT_EQ(report.warnings[0].code, "DAT-EXCHANGED");
  EXPECT_NE(report.warnings[0].text.find("the footage of cam_a and cam_c seems to be exchanged"), std::string::npos);
  EXPECT_NE(report.warnings[0].hint.find("option 'video' cam_a=FILE"), std::string::npos);
  for (const Notice& warning : report.warnings) EXPECT_EQ(warning.text.find("only "), std::string::npos) << "a consequence";
  int errors = 0;
  for (const Finding& f : VerifyDataset(folder_ / "dataset").findings)
    errors += (f.code == "DAT-EXCHANGED" || f.code == "DAT-IMAGE-MASK") && f.text.find("exchanged") != std::string::npos;
  EXPECT_GE(errors, 1);
}

TEST_F(BuildTest, SidecarNamesTheSources) {
  BuildDataset(inputs_, folder_ / "dataset", options_);
  const json sidecar = json::parse(ReadFile(folder_ / "dataset/dataset.json"));
  EXPECT_EQ(sidecar["schema"], "mvstudio.dataset/1");
  EXPECT_EQ(sidecar["frame_rate_hz"], 15);
  EXPECT_EQ(sidecar["cameras"][2]["alias"], "cam_c");
  EXPECT_EQ(sidecar["cameras"][2]["source"]["sha256"], Sha256File(Video(2)));
  EXPECT_EQ(sidecar["frames"].size(), static_cast<size_t>(kFrames));
}

TEST_F(BuildTest, ImagesWithNumbersInTheirNames) {
  options_.png = true;
  options_.masks = false;
  inputs_.footage = {{Alias(0), folder_ / "pictures/view*.png", ""}};
  for (int f = 0; f < kFrames; ++f) WriteImage(TruthImage(0, f), folder_ / ("pictures/view" + std::to_string(f) + ".png"));
  BuildDataset(inputs_, folder_ / "dataset", options_);
  const PanopticDataset built = OpenPanopticDataset(folder_ / "dataset");
  EXPECT_EQ(ReadImage(built.ImagePath("00_00", 11)).pixels, TruthImage(0, 11).pixels);
  fs::remove(folder_ / "pictures/view7.png");
  EXPECT_NE(FailedBuild<FormatError>().find("frame 7"), std::string::npos);
}

TEST_F(BuildTest, SlightlyOtherSizeIsExplainedAndTheCameraFollows) {
  WriteVideo(1, 6);
  const BuildReport report = BuildDataset(inputs_, folder_ / "dataset", options_);
  ASSERT_EQ(report.warnings.size(), 1u);
  EXPECT_EQ(report.warnings[0].code, "DAT-SIZE");
  EXPECT_NE(report.warnings[0].text.find("cam_b"), std::string::npos);
  EXPECT_NE(report.warnings[0].text.find("378x384"), std::string::npos);
  EXPECT_EQ(report.cameras[1].size_rule, "crop-right") << report.warnings[0].text;
  const PanopticDataset built = OpenPanopticDataset(folder_ / "dataset");
  EXPECT_EQ(built.rig.cameras[1].camera.width_px, 378);
  EXPECT_EQ(built.rig.cameras[1].camera.params, person_.rig.cameras[1].camera.params);
  EXPECT_EQ(VerifyDataset(folder_ / "dataset").num_errors(), 0);
}

TEST_F(BuildTest, OtherSizeIsRefused) {
  WriteVideo(1, 64);
  const std::string text = FailedBuild<FormatError>();
  EXPECT_NE(text.find("camera cam_b"), std::string::npos) << text;
  EXPECT_NE(text.find("320x384"), std::string::npos) << text;
}

TEST_F(BuildTest, CameraThatIsNotCalibrated) {
  inputs_.footage[1].camera = "cam_x";
  const std::string text = FailedBuild<FormatError>();
  EXPECT_NE(text.find("cam_x"), std::string::npos) << text;
  EXPECT_NE(text.find("cam_a, cam_b, cam_c"), std::string::npos) << text;
}

TEST_F(BuildTest, JointsOfAnotherWorldAreRefused) {
  WritePoses({0, 0, 60});
  const std::string text = FailedBuild<FormatError>();
  EXPECT_NE(text.find("no joint lies in the view of any camera"), std::string::npos) << text;
}

TEST_F(BuildTest, ACameraThatSeesNobodyIsNamed) {
  geometry::Rig rig = geometry::ReadRig(inputs_.calibration);
  const Eigen::Quaterniond back(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitY()));
  rig.cameras[1].cam_from_world = geometry::Rigid3{back, Eigen::Vector3d::Zero()} * rig.cameras[1].cam_from_world;
  geometry::WriteRig(rig, inputs_.calibration);
  const BuildReport report = BuildDataset(inputs_, folder_ / "out/dataset", options_);
  const auto told =
      std::find_if(report.warnings.begin(), report.warnings.end(), [](const Notice& w) { return w.code == "DAT-VIEW"; });
  ASSERT_NE(told, report.warnings.end());
  EXPECT_NE(told->text.find("cam_b"), std::string::npos) << told->text;
}

TEST_F(BuildTest, TruncatedVideoNamesCameraAndFrame) {
  Truncate(Video(2), folder_ / "cut.mp4", 0.8);
  inputs_.footage[2].path = folder_ / "cut.mp4";
  const std::string text = FailedBuild<FormatError>();
  EXPECT_NE(text.find("camera cam_c, frame "), std::string::npos) << text;
}

TEST_F(BuildTest, UsageErrors) {
  EXPECT_THROW(FromString("guess", &options_.size_rule), UsageError);
  inputs_.footage[1] = inputs_.footage[0];
  FailedBuild<UsageError>();
  inputs_.footage.clear();
  FailedBuild<UsageError>();
}

}  // namespace
}  // namespace mvstudio::dataset
