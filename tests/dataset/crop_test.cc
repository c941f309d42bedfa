#include "dataset/views/crop.h"

#include <cmath>

#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/views/undistort.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/geometry/lens_samples.h"
#include "tests/support/message_of.h"

namespace mvstudio::dataset {
namespace {

using geometry::testing::MakeLens;
using mvstudio::testing::MessageOf;

/// Looks along +y from `distance` metres before the origin, 1 m high, a little rolled.
geometry::RigCamera Looking(const geometry::Camera& lens, double distance = 3) {
  geometry::RigCamera camera;
  camera.camera = lens;
  Eigen::Matrix3d cam_from_world;
  cam_from_world << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  const Eigen::Quaterniond roll(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitZ()));
  camera.cam_from_world.rotation = roll * Eigen::Quaterniond(cam_from_world);
  camera.cam_from_world.translation = -(camera.cam_from_world.rotation * Eigen::Vector3d(0, -distance, 1));
  return camera;
}

geometry::Camera BrownLens(int width = 640, int height = 480, double focal = 600) {
  return MakeLens(geometry::LensModel::kBrown5, {-0.25, 0.12, 8e-4, -5e-4, 0.03}, width, height, focal);
}

geometry::RigCamera CropOf(const Coco19Pose& pose, const geometry::RigCamera& camera, int size) {
  const auto extent = MeasurePerson(pose, camera);
  return CropCamera(camera, extent->middle_in_cam, extent->half_extent_m, 0.97, size);
}

TEST(Crop, JointsProjectWhereTheResampledImageHasThem) {
  for (const geometry::Camera& lens : geometry::testing::OrdinaryLenses()) {
    const geometry::RigCamera camera = Looking(lens, 4);
    const Coco19Pose pose = StandingPerson(0.3);
    const geometry::RigCamera crop = CropOf(pose, camera, 192);
    const ResampleMap map(camera, crop);
    for (int j = 0; j < 19; ++j) {
      const Eigen::Vector3d x = pose.x_in_world.col(j);
      const geometry::Projection exact = geometry::Project(camera.camera, camera.cam_from_world * x),
                                 cropped = geometry::Project(crop.camera, crop.cam_from_world * x);
      ASSERT_EQ(exact.status, Status::kOk);
      ASSERT_EQ(cropped.status, Status::kOk);
      EXPECT_LT((map.SourceOf(cropped.px) - exact.px).norm(), 1e-9) << lens.name << " joint " << j;
      EXPECT_LT((map.SampledSourceOf(cropped.px) - exact.px).norm(), 2e-3 * map.samples_per_side())
          << lens.name << " joint " << j;
    }
  }
}

TEST(Crop, AJointsPixelStaysItsPixel) {
  const geometry::RigCamera camera = Looking(BrownLens());
  const Coco19Pose pose = StandingPerson(0);
  Image source(640, 480, 3);
  for (int j = 0; j < 19; ++j) {  // a blob of 7 px at each joint, in a colour of its own
    const Eigen::Vector2d px =
        geometry::Project(camera.camera, camera.cam_from_world * Eigen::Vector3d(pose.x_in_world.col(j))).px;
    for (int i = 0; i < 49; ++i) {
      uint8_t* p = source.Pixel(static_cast<int>(px[0] + 0.5) + i % 7 - 3, static_cast<int>(px[1] + 0.5) + i / 7 - 3);
      p[0] = 200, p[1] = static_cast<uint8_t>(10 * j), p[2] = 77;
    }
  }
  const geometry::RigCamera crop = CropOf(pose, camera, 512);
  const Image out = Resample(source, camera, crop);
  for (const int j : {5, 8, 11, 14}) {  // no other joint near
    const Eigen::Vector2d px = geometry::Project(crop.camera, crop.cam_from_world * Eigen::Vector3d(pose.x_in_world.col(j))).px;
    EXPECT_NEAR(out.Pixel(static_cast<int>(px[0] + 0.5), static_cast<int>(px[1] + 0.5))[1], 10 * j, 1) << j;
  }
}

TEST(Crop, MasksKeepTheirCoverage) {
  const geometry::RigCamera camera = Looking(BrownLens());
  const geometry::RigCamera crop = CropCamera(camera, {0, 0, 3}, 1.1, 0.97, 96);
  Image mask(640, 480, 1);
  for (int y = 0; y < 480; ++y) std::fill(mask.Pixel(0, y), mask.Pixel(0, y) + 300 + y / 4, 255);
  const ResampleMap map(camera, crop);
  const Image out = map.Mask(mask), soft = map.Apply(mask);
  int differ = 0;
  for (size_t i = 0; i < out.pixels.size(); ++i) {
    ASSERT_TRUE(out.pixels[i] == 0 || out.pixels[i] == 255);
    ASSERT_EQ(out.pixels[i] == 255, soft.pixels[i] >= 128);
    const Eigen::Vector2d s = map.SourceOf({static_cast<double>(i % 96), static_cast<double>(i / 96)});
    if (s.minCoeff() < 10 || s[0] > 630 || s[1] > 470) continue;
    const double edge = 299.5 + std::floor(s[1] + 0.5) / 4;
    if (std::abs(s[0] - edge) > 1.5) differ += (out.pixels[i] == 255) != (s[0] < edge);
  }
  EXPECT_EQ(differ, 0);
}

/// Reference: the mean of 24 x 24 exact bilinear samples.
double ExactMean(const Image& image, const ResampleMap& map, int x, int y) {
  constexpr int kSide = 24;
  double sum = 0;
  for (int i = 0; i < kSide * kSide; ++i) {
    const Eigen::Vector2d s = map.SourceOf({x + (i % kSide + 0.5) / kSide - 0.5, y + (i / kSide + 0.5) / kSide - 0.5});
    const int x0 = static_cast<int>(std::floor(s[0])), y0 = static_cast<int>(std::floor(s[1]));
    const double fx = s[0] - x0, fy = s[1] - y0;
    const auto at = [&](int dx, int dy) { return static_cast<double>(*image.Pixel(x0 + dx, y0 + dy)); };
    sum += (1 - fy) * ((1 - fx) * at(0, 0) + fx * at(1, 0)) + fy * ((1 - fx) * at(0, 1) + fx * at(1, 1));
  }
  return sum / (kSide * kSide);
}

TEST(Resample, IsTheMeanOverTheFootprint) {
  const geometry::RigCamera camera = Looking(BrownLens(800, 600, 700));
  Image source = RandomImage(800, 600, 1, 3);
  for (int size : {64, 128, 400}) {
    const geometry::RigCamera crop = CropCamera(camera, {0.1, 0, 3}, 0.7, 1, size);
    const ResampleMap map(camera, crop);
    const Image out = map.Apply(source);
    double sum = 0;
    int count = 0;
    for (int y = 3; y < size; y += size / 8) {
      for (int x = 3; x < size; x += size / 8) {
        const double difference = *out.Pixel(x, y) - ExactMean(source, map, x, y);
        sum += difference * difference, ++count;
      }
    }
    // White noise is the worst image there is; its own standard deviation is 74.
    EXPECT_LT(std::sqrt(sum / count), size == 64 ? 2.5 : size == 128 ? 5 : 14) << size;
  }
}

TEST(Resample, ColourChannelsAndThreadsAgree) {
  const geometry::RigCamera camera = Looking(BrownLens());
  const geometry::RigCamera crop = CropCamera(camera, {0.9, 0.5, 3}, 1.2, 1, 150);  // partly outside
  const Image rgb = RandomImage(640, 480, 3, 5);
  const ResampleMap map(camera, crop);
  const Image out = map.Apply(rgb);
  EXPECT_EQ(out.pixels, map.Apply(rgb, Border::kBlack, 3).pixels);
  for (int k = 0; k < 3; ++k) {
    Image one(640, 480, 1);
    for (size_t i = 0; i < one.pixels.size(); ++i) one.pixels[i] = rgb.pixels[3 * i + k];
    const Image single = map.Apply(one);
    for (size_t i = 0; i < single.pixels.size(); ++i) ASSERT_EQ(single.pixels[i], out.pixels[3 * i + k]) << i;
  }
}

TEST(Resample, BordersAreBlackOrLeftAsTold) {
  const geometry::RigCamera camera = Looking(BrownLens());
  const geometry::RigCamera crop = CropCamera(camera, {2.0, 0, 3}, 1.5, 1, 120);
  const ResampleMap map(camera, crop);
  const Image white(640, 480, 3, 201);
  const Image black = map.Apply(white), left = map.Apply(white, Border::kLeave), valid = map.Validity();
  int partial = 0, none = 0;
  for (size_t i = 0; i < valid.pixels.size(); ++i) {
    const int b = black.pixels[3 * i], l = left.pixels[3 * i];
    EXPECT_EQ(l, b == 0 ? l : 201);
    EXPECT_EQ(valid.pixels[i] == 255, b >= 101) << b;
    partial += b > 0 && b < 201, none += l == 0;
  }
  EXPECT_GT(partial, 20);
  EXPECT_GT(none, 1000);
}

TEST(Resample, TinyAndHugePeopleAndPeopleBehind) {
  const geometry::RigCamera camera = Looking(BrownLens());
  const Image speck = Resample(Image(640, 480, 3, 50), camera, CropCamera(camera, {0, 0, 3}, 100, 1, 65));
  const double share =
      640.0 * 480 / (600 * 600) / std::pow(100 / 32.5 / 3, 2);  // of the pixel that the image fills, undistorted
  EXPECT_NEAR(speck.Pixel(32, 32)[0], 50 * share, 8);
  EXPECT_EQ(Resample(Image(640, 480, 3, 50), camera, CropCamera(camera, {0, 0, 3}, 1e-4, 1, 64)).Pixel(5, 60)[0], 50);
  EXPECT_EQ(Resample(Image(640, 480, 3, 50), camera, CropCamera(camera, {0, 0, 3}, 1, 1, 1)).width, 1);
  Coco19Pose behind = StandingPerson(0);
  behind.x_in_world.row(1).array() -= 6;
  EXPECT_FALSE(MeasurePerson(behind, camera).has_value());
  Coco19Pose nowhere = StandingPerson(0);
  nowhere.x_in_world.setConstant(std::nan(""));
  EXPECT_FALSE(MeasurePerson(nowhere, camera).has_value());
  EXPECT_THROW(CropCamera(camera, {0, 0, -1}, 1, 1, 64), ContractViolation);
}

TEST(Resample, FoldingLensesShowNothingTwice) {
  for (const geometry::Camera& lens : geometry::testing::ExtremeLenses()) {
    const geometry::RigCamera camera = Looking(lens);
    const geometry::RigCamera crop = CropCamera(camera, {0, 0, 3}, 6, 1, 64);
    const ResampleMap map(camera, crop);
    const Image out = map.Apply(Image(lens.width_px, lens.height_px, 1, 90));
    for (int i = 0; i < 64 * 64; ++i) {
      const Eigen::Vector2d px(i % 64, i / 64), s = map.SourceOf(px);
      const bool far_inside = s.allFinite() && s.minCoeff() > 200 && s[0] < lens.width_px - 200 && s[1] < lens.height_px - 200;
      if (far_inside) {
        EXPECT_GT(out.pixels[i], 0) << lens.name << px.transpose();
      }
      EXPECT_LE(out.pixels[i], 90);
    }
    EXPECT_EQ(*out.Pixel(32, 32), 90) << lens.name;
  }
}

TEST(Undistort, PinholesOfEveryLensAreExact) {
  for (geometry::Camera lens : geometry::testing::OrdinaryLenses()) {
    for (const UndistortView view :
         {UndistortView::kInside, UndistortView::kAll, UndistortView::kKeep, UndistortView::kCentred}) {
      const geometry::RigCamera source = Looking(lens);
      UndistortOptions options;
      options.view = view, options.width_px = 320, options.height_px = 240;
      const UndistortedCamera ideal = IdealPinhole(source, options);
      ASSERT_TRUE(ideal.usable()) << lens.name << ideal.reason;
      EXPECT_EQ(ideal.camera.camera.model, geometry::LensModel::kPinhole);
      EXPECT_EQ(ideal.camera.camera.width_px, 320);
      EXPECT_EQ((ideal.camera.CenterInWorld() - source.CenterInWorld()).norm(), 0);
      if (options.view == UndistortView::kInside || options.view == UndistortView::kCentred) {
        EXPECT_EQ(ideal.empty_share, 0) << lens.name;
      }
      EXPECT_TRUE(options.view != UndistortView::kCentred || IsCentred(ideal.camera.camera)) << lens.name;
      if (options.view == UndistortView::kAll && ideal.status == Status::kOk) {
        EXPECT_EQ(ideal.lost_share, 0) << lens.name;
      }
      EXPECT_EQ(ideal.status == Status::kOk, ideal.reason.empty());
      EXPECT_TRUE(ideal.status == Status::kOk || IsWide(lens.model)) << lens.name << ideal.reason;
    }
  }
}

TEST(Undistort, StatesItsError) {
  for (const geometry::Camera& lens :
       {BrownLens(320, 240, 300), MakeLens(geometry::LensModel::kKannalaBrandt4, {0.02, -0.008, 0.002, 0}, 320, 240, 150),
        geometry::testing::MakeSplined({3, 11, 10, 150}, 0.01, 125, 320, 240)}) {
    const geometry::RigCamera source = Looking(lens);
    const UndistortedCamera ideal = IdealPinhole(source, {});
    const UndistortionError error = MeasureUndistortion(source, ideal.camera);
    EXPECT_LT(error.max_joint_px, 1e-9) << lens.name;
    EXPECT_LT(error.max_map_px, 5e-3) << lens.name;
    EXPECT_GT(error.psnr_db, 40) << lens.name << " waves of " << error.finest_px << " px and longer";
    EXPECT_LT(error.psnr_db, 80);
    EXPECT_EQ(MeasureUndistortion(source, ideal.camera, 1, false).max_map_px, error.max_map_px);
    std::printf("%s: joints %.1g px, map %.1g px, there and back %.1f dB (waves of %.0f px and longer)\n", lens.name.c_str(),
                error.max_joint_px, error.max_map_px, error.psnr_db, error.finest_px);
  }
}

TEST(Undistort, NothingToDoChangesNothing) {
  const geometry::RigCamera source = Looking(MakeLens(geometry::LensModel::kPinhole, {}, 64, 48, 60));
  const UndistortedCamera ideal = IdealPinhole(source, {});
  EXPECT_EQ(ideal.camera.camera.params, source.camera.params);
  const Image image = RandomImage(64, 48, 3, 1);
  EXPECT_EQ(Undistorter(source, ideal.camera).Apply(image).pixels, image.pixels);
}

TEST(Undistort, PinholesAreCentredOnlyWhereAskedFor) {
  geometry::Camera lens = geometry::MakePinhole("p", 64, 48, 60);
  UndistortOptions centred;
  centred.view = UndistortView::kCentred;
  EXPECT_EQ(IdealPinhole(Looking(lens), centred).camera.camera.params, lens.params);
  lens.params[2] += 4, lens.params[3] -= 2;
  EXPECT_FALSE(IsCentred(lens));
  EXPECT_EQ(IdealPinhole(Looking(lens), {}).camera.camera.params, lens.params);
  const UndistortedCamera ideal = IdealPinhole(Looking(lens), centred);
  EXPECT_TRUE(IsCentred(ideal.camera.camera));
  EXPECT_EQ(ideal.empty_share, 0);
  // 4 px of 32 are lost at the side: the half width in front of the axis is 28 px, and pixels keep their shape.
  EXPECT_NEAR(ideal.camera.camera.fx(), 60 * 32.0 / 28, 1e-6);
  EXPECT_NEAR(ideal.camera.camera.fy(), 60 * 32.0 / 28, 1e-6);
  lens.params[2] = 200;  // the axis is outside the image
  const UndistortedCamera aside = IdealPinhole(Looking(lens), centred);
  EXPECT_EQ(aside.status, Status::kDegenerate);
  EXPECT_NE(aside.reason.find("optical axis"), std::string::npos);
}

TEST(Undistort, StraightLinesBecomeStraight) {
  const geometry::RigCamera source = Looking(BrownLens());
  const UndistortedCamera ideal = IdealPinhole(source, {});
  const geometry::Projector lens(source.camera);
  Image image(640, 480, 1);
  for (int i = 0; i < 640 * 480; ++i) {  // left of the plane x = 0.3 z it is white
    const Eigen::Vector3d ray = lens.Unproject({static_cast<double>(i % 640), static_cast<double>(i / 640)}).ray_in_cam;
    image.pixels[i] = ray[0] < 0.3 * ray[2] ? 255 : 0;
  }
  const Undistorter undistorter(source, ideal.camera);
  const Image out = undistorter.Apply(image);
  const double edge = ideal.camera.camera.cx() + 0.3 * ideal.camera.camera.fx();
  for (int y = 0; y < 480; ++y) {
    double bright = 0;
    for (int x = 0; x < 640; ++x) bright += *out.Pixel(x, y) / 255.0;
    EXPECT_NEAR(bright - 0.5, edge, 0.6) << y;
  }
  EXPECT_EQ(undistorter.Validity().pixels, std::vector<uint8_t>(640 * 480, 255));
}

TEST(Undistort, WideLensesSayWhatIsLost) {
  const geometry::RigCamera fisheye = Looking(MakeLens(geometry::LensModel::kKannalaBrandt4, {0, 0, 0, 0}, 1280, 960, 300));
  const UndistortedCamera ideal = IdealPinhole(fisheye, {});
  EXPECT_EQ(ideal.status, Status::kOutsideValidRadius);
  EXPECT_TRUE(ideal.usable());
  EXPECT_GT(ideal.lost_share, 0.3);
  EXPECT_NE(ideal.reason.find("150 degrees"), std::string::npos) << ideal.reason;
  UndistortOptions narrow;
  narrow.max_fov_deg = 60, narrow.view = UndistortView::kAll;
  EXPECT_GT(IdealPinhole(fisheye, narrow).lost_share, IdealPinhole(fisheye, {}).lost_share);
}

TEST(Undistort, RefusesWhatIsNoLens) {
  geometry::RigCamera camera = Looking(BrownLens());
  camera.camera.params[5] = std::nan("");
  EXPECT_EQ(IdealPinhole(camera, {}).status, Status::kNonFiniteInput);
  camera = Looking(BrownLens());
  camera.cam_from_world.translation[0] = INFINITY;
  EXPECT_EQ(IdealPinhole(camera, {}).status, Status::kNonFiniteInput);
  camera = Looking(BrownLens());
  camera.camera.params[0] = 0;
  EXPECT_EQ(IdealPinhole(camera, {}).status, Status::kDegenerate);
  camera = Looking(BrownLens());
  camera.camera.width_px = 0;
  EXPECT_EQ(IdealPinhole(camera, {}).status, Status::kDegenerate);
  EXPECT_FALSE(IdealPinhole(camera, {}).reason.empty());
  UndistortOptions wrong;
  EXPECT_NE(MessageOf<UsageError>([&] { FromString("fisheye", &wrong.view); }).find("inside, all, keep or centred"),
            std::string::npos);
  wrong.width_px = -3;
  EXPECT_THROW(IdealPinhole(camera, wrong), UsageError);
  wrong = {};
  wrong.max_fov_deg = 180;
  EXPECT_THROW(IdealPinhole(camera, wrong), UsageError);
}

TEST(Undistort, ExtremesGiveACameraOrAReason) {
  std::vector<geometry::Camera> lenses = geometry::testing::ExtremeLenses();
  lenses.push_back(MakeLens(geometry::LensModel::kBrown1, {-50}));
  lenses.push_back(MakeLens(geometry::LensModel::kBrown5, {1e6, -1e9, 0.5, -0.5, 1e12}));
  lenses.push_back(MakeLens(geometry::LensModel::kBrown5, {0, 0, 0, 0, 13.3}));
  lenses.push_back(BrownLens(1, 1, 600));
  lenses.push_back(BrownLens(2, 1, 0.5));
  geometry::Camera aside = BrownLens();
  aside.params[2] = 5000;  // the axis lies outside the image
  lenses.push_back(aside);
  for (const geometry::Camera& lens : lenses) {
    for (const UndistortView view :
         {UndistortView::kInside, UndistortView::kAll, UndistortView::kKeep, UndistortView::kCentred}) {
      UndistortOptions options;
      options.view = view;
      const UndistortedCamera ideal = IdealPinhole(Looking(lens), options);
      if (!ideal.usable()) {
        EXPECT_FALSE(ideal.reason.empty());
        continue;
      }
      EXPECT_TRUE(ideal.camera.camera.params.allFinite());
      EXPECT_GE(ideal.lost_share, 0);
      EXPECT_LE(ideal.lost_share, 1);
      if (options.view == UndistortView::kInside || options.view == UndistortView::kCentred) {
        EXPECT_LT(ideal.empty_share, 0.02) << lens.name << lens.params.transpose();
      }
    }
  }
}

TEST(Crop, PersonAStaysInItsCrops) {
  if (!mvstudio::testing::HasData("person_a")) GTEST_SKIP() << "person_a is not there";
  const PanopticDataset data = OpenPanopticDataset(DataFolder("person_a"));
  for (const geometry::RigCamera& camera : data.rig.cameras) {
    const Image mask = ReadImage(data.MaskPath(camera.camera.name, 30), true);
    const geometry::RigCamera crop = CropOf(data.poses.at(30).at(0), camera, 128);
    const Image out = ResampleMap(camera, crop).Mask(mask);
    int64_t border = 0, area = 0;
    for (int i = 0; i < 128 * 128; ++i) {
      area += out.pixels[i] == 255;
      border += out.pixels[i] == 255 && (i % 128 == 0 || i % 128 == 127 || i / 128 == 0 || i / 128 == 127);
    }
    EXPECT_EQ(border, 0) << camera.camera.name;
    EXPECT_GT(area, 1000);
    const double scale = crop.camera.fx() / camera.camera.fx();
    const double full = static_cast<double>(std::count(mask.pixels.begin(), mask.pixels.end(), 255));
    EXPECT_NEAR(static_cast<double>(area) / (full * scale * scale), 1, 0.08) << camera.camera.name;
  }
}

}  // namespace
}  // namespace mvstudio::dataset
