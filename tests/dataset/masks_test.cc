#include "dataset/masks/masks.h"

#include <limits>
#include <numeric>

#include "core/error.h"
#include "dataset/masks/mask_take.h"
#include "geometry/lens/camera.h"
#include "tests/dataset/dataset_test_util.h"

namespace mvstudio::dataset {
namespace {

geometry::RigCamera FrontCamera() {
  geometry::RigCamera c;
  c.camera = geometry::MakePinhole("cam", 320, 320, 400);
  Eigen::Matrix3d axes;
  axes << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  c.cam_from_world.rotation = Eigen::Quaterniond(axes);
  c.cam_from_world.translation << 0, 1.0, 3.0;
  return c;
}

double Iou(const Image& a, const Image& b) {
  double both = 0, either = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) both += a.pixels[i] && b.pixels[i], either += a.pixels[i] || b.pixels[i];
  return both / either;
}

/// A room with stripes, a person in two colours that walks to the right (or stands), exposure that drifts.
struct Scene {
  std::vector<Image> frames, truth;
  std::vector<ProjectedBody> bodies;
  Image plate;
};

Scene MakeScene(double step_m, double drift) {
  Scene scene;
  const geometry::RigCamera camera = FrontCamera();
  const auto paint = [&](int f, const Image* body) {
    const Image noise = RandomImage(320, 320, 3, 7 + f);
    Image image(320, 320, 3);
    for (int y = 0; y < 320; ++y) {
      for (int x = 0; x < 320; ++x) {
        const bool person = body && *body->Pixel(x, y);
        for (int k = 0; k < 3; ++k) {
          double v = (x / 20) % 2 ? 170 - 10 * k : 120 + 8 * k;
          if (person) v = y < 150 ? (k == 0 ? 190 : 60) : (k == 2 ? 110 : 40);
          v = v * (1 + drift * f) + noise.Pixel(x, y)[k] / 64.0 - 2;
          image.Pixel(x, y)[k] = static_cast<uint8_t>(std::clamp(v, 0.0, 255.0));
        }
      }
    }
    return image;
  };
  for (int f = 0; f < 10; ++f) {
    scene.bodies.push_back(ProjectBody({{0, StandingPerson(step_m * (f - 5))}}, camera));
    scene.truth.push_back(BodyRegion(scene.bodies.back(), 320, 320, 0.012));  // wider than the model's idea of it
    scene.frames.push_back(paint(f, &scene.truth.back()));
  }
  scene.plate = paint(0, nullptr);
  return scene;
}

double MeanIou(const Scene& scene, const CameraMaskModel& model) {
  double sum = 0;
  int count = 0;
  for (size_t f = 0; f < scene.frames.size(); f += 3, ++count)
    sum += Iou(SegmentBody(scene.frames[f], scene.bodies[f], model).mask, scene.truth[f]);
  return sum / count;
}

struct LearnedScene {
  Scene scene;
  CameraMaskModel model;
};
/// The scene that most tests use, learned once.
const LearnedScene& Walking() {
  static const LearnedScene walking = [] {
    LearnedScene s{MakeScene(0.12, 0), {}};
    s.model = LearnCamera(s.scene.frames, s.scene.bodies, nullptr);
    return s;
  }();
  return walking;
}

TEST(Masks, WalkingPersonIsCutOut) {
  const auto& [scene, model] = Walking();
  EXPECT_GT(model.background.KnownFraction(), 0.9);
  EXPECT_GT(MeanIou(scene, model), 0.97);
}

TEST(Masks, StandingPersonIsNotTakenForBackground) {
  const Scene scene = MakeScene(0, 0);
  const CameraMaskModel model = LearnCamera(scene.frames, scene.bodies, nullptr);
  for (size_t i = 0; i < scene.truth[0].pixels.size(); ++i) {
    if (scene.truth[0].pixels[i]) {
      ASSERT_EQ(model.background.known[i], 0) << "pixel " << i << " under the person";
    }
  }
  EXPECT_GT(MeanIou(scene, model), 0.95);
}

TEST(Masks, ExposureDriftIsTolerated) {
  const Scene scene = MakeScene(0.12, 0.015);
  EXPECT_GT(MeanIou(scene, LearnCamera(scene.frames, scene.bodies, nullptr)), 0.96);
}

TEST(Masks, PlateReplacesTheTake) {
  const Scene scene = MakeScene(0, 0);
  EXPECT_GT(MeanIou(scene, LearnCamera(scene.frames, scene.bodies, &scene.plate)), 0.97);
  const Image wrong(10, 10, 3);
  EXPECT_THROW(LearnCamera(scene.frames, scene.bodies, &wrong), ContractViolation);
}

TEST(Masks, BonesAreForegroundAndTheSameInputGivesTheSameMask) {
  const auto& [scene, model] = Walking();
  // The person is elsewhere: colours speak against every bone.
  const BodyMask mask = SegmentBody(scene.plate, scene.bodies[4], model);
  for (const auto& [a, b] : scene.bodies[4].bones) {
    const Eigen::Vector2d middle = 0.5 * (a + b);
    int most = 0;  // the drawn line may pass a pixel beside the exact middle
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        most = std::max<int>(most, *mask.mask.Pixel(int(std::lround(middle.x())) + dx, int(std::lround(middle.y())) + dy));
      }
    }
    EXPECT_EQ(most, 255);
  }
  EXPECT_LT(mask.joints_supported, mask.joints / 4);
  const BodyMask once = SegmentBody(scene.frames[2], scene.bodies[2], model);
  EXPECT_EQ(once.mask.pixels, SegmentBody(scene.frames[2], scene.bodies[2], model).mask.pixels);
  EXPECT_EQ(once.joints_on_mask, once.joints);
}

TEST(Masks, NobodyInViewGivesAnEmptyMask) {
  const auto& [scene, model] = Walking();
  const BodyMask mask = SegmentBody(scene.frames[0], ProjectedBody{}, model);
  EXPECT_EQ(std::accumulate(mask.mask.pixels.begin(), mask.mask.pixels.end(), 0), 0);
  EXPECT_EQ(mask.joints, 0);
}

/// A bracelet of the wall's colour parts a hand from its arm; a stray object of the hand's size lies beside the body.
TEST(Masks, APartOfTheBodyThatIsCutOffStays) {
  const auto& [scene, model] = Walking();
  ProjectedBody body;
  body.limbs = {{{60, 60}, {60, 200}, 16, 16, 100}, {{60, 200}, {60, 260}, 16, 16, 100}};
  body.bones = {{{60, 60}, {60, 200}}};
  Image rgb = scene.plate;
  const auto paint = [&](int x0, int y0, int x1, int y1) {
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) rgb.Pixel(x, y)[0] = 190, rgb.Pixel(x, y)[1] = rgb.Pixel(x, y)[2] = 60;
    }
  };
  paint(48, 50, 73, 205), paint(48, 225, 73, 270), paint(90, 100, 98, 140);
  const Image mask = SegmentBody(rgb, body, model).mask;
  EXPECT_EQ(*mask.Pixel(60, 245), 255);
  EXPECT_EQ(*mask.Pixel(60, 215), 0);
  EXPECT_EQ(*mask.Pixel(94, 120), 0);
}

/// Two rectangles, sampled 8 x 8 times a pixel and mixed in linear light, as a lens does.
TEST(Masks, OutlineFollowsHalfCoverage) {
  const auto light = [](double v) { return std::pow(v / 255, 2.2); };
  const auto level = [](double l) { return 255 * std::pow(l, 1 / 2.2); };
  const auto inside = [](double x, double y) {  // slanted edges: every coverage occurs
    return x > 60.3 + 0.1 * y && x < 100.6 + 0.07 * y && y > 30.2 && y < 170.7;
  };
  Image rgb(160, 200, 3), plate(160, 200, 3), truth(160, 200, 1, 0);
  for (int y = 0; y < 200; ++y) {
    for (int x = 0; x < 160; ++x) {
      double covered = 0;
      for (int s = 0; s < 64; ++s) covered += inside(x - 0.4375 + 0.125 * (s % 8), y - 0.4375 + 0.125 * (s / 8)) / 64.0;
      *truth.Pixel(x, y) = covered >= 0.5 ? 255 : 0;
      for (int k = 0; k < 3; ++k) {
        const double behind = 200 - 20 * k + 10 * ((x / 9) % 2), person = 40 + 30 * k;
        plate.Pixel(x, y)[k] = uint8_t(behind);
        rgb.Pixel(x, y)[k] = uint8_t(std::lround(level(covered * light(person) + (1 - covered) * light(behind))));
      }
    }
  }
  ProjectedBody body;
  body.limbs = {{{85, 50}, {92, 150}, 20, 20, 100}};
  body.bones = {{{85, 50}, {92, 150}}};
  MaskOptions rough;
  rough.outline_px = 0;
  const CameraMaskModel model = LearnCamera({rgb}, {body}, &plate);
  const BodyMask mask = SegmentBody(rgb, body, model);
  EXPECT_GT(Iou(mask.mask, truth), 0.995);
  EXPECT_GE(Iou(mask.mask, truth), Iou(SegmentBody(rgb, body, model, rough).mask, truth));
  for (size_t i = 0; i < mask.mask.pixels.size(); ++i) ASSERT_EQ(mask.soft.pixels[i] >= 128, mask.mask.pixels[i] == 255);
}

TEST(Masks, WithoutJointsMotionTellsWhoIsThere) {
  const Scene scene = MakeScene(0.16, 0);
  const MotionModel motion = FindMotion(scene.frames, nullptr);
  ASSERT_EQ(motion.status, Status::kOk);
  EXPECT_GT(Iou(motion.moving[4], scene.truth[4]), 0.7);
  const CameraMaskModel model = LearnCameraFromMasks(scene.frames, motion.moving, motion.moving, nullptr);
  EXPECT_GT(Iou(SegmentPeople(scene.frames[4], {}, model).mask, scene.truth[4]), 0.9);

  const Scene still = MakeScene(0, 0);
  EXPECT_EQ(FindMotion(still.frames, nullptr).status, Status::kDegenerate);
  EXPECT_EQ(FindMotion(still.frames, &still.plate).status, Status::kOk);
}

TEST(Masks, HintsMoveTheDecision) {
  const auto& [scene, model] = Walking();
  MaskHints hints;
  hints.body = &scene.bodies[3];
  Image left_only(320, 320, 1, 255);
  for (int y = 0; y < 320; ++y) std::fill_n(left_only.Pixel(160, y), 160, uint8_t{0});
  hints.possible = &left_only;
  const Image mask = SegmentPeople(scene.frames[3], hints, model).mask;
  int right = 0, left = 0;
  for (int y = 0; y < 320; ++y) {
    for (int x = 0; x < 320; ++x) (x < 158 ? left : right) += *mask.Pixel(x, y) != 0 && (x < 158 || x > 163);
  }
  EXPECT_GT(left, 20 * right);
  const Image wrong(10, 10, 1);
  hints.possible = &wrong;
  EXPECT_THROW(SegmentPeople(scene.frames[3], hints, model), ContractViolation);
}

TEST(Masks, ExtremesGiveAMaskOfTheRightSize) {
  for (const auto& [w, h] : {std::pair(1, 1), std::pair(1, 40), std::pair(64, 48)}) {
    const Image black(w, h, 3, 0);
    ProjectedBody body;  // covers everything and touches all borders
    body.limbs = {{{-5, -5}, {w + 5.0, h + 5.0}, 100, 100, 200}};
    body.bones = {{{0, 0}, {w - 1.0, h - 1.0}}};
    const CameraMaskModel model = LearnCamera({black, black}, {body, body}, nullptr);
    EXPECT_EQ(model.background.KnownFraction(), 0);  // never seen, and said so
    const BodyMask mask = SegmentBody(black, body, model);
    EXPECT_EQ(mask.mask.width, w);
    EXPECT_EQ(mask.mask.height, h);
    EXPECT_EQ(FindMotion({black, black}, nullptr).status, Status::kDegenerate);
    const CameraMaskModel empty = LearnCameraFromMasks({black}, {Image(w, h, 1, 0)}, {Image(w, h, 1, 0)}, nullptr);
    EXPECT_EQ(SegmentPeople(black, {}, empty).area_fraction, 0);
  }
}

TEST(Masks, JointsThatAreNoNumbersAreLeftOut) {
  Coco19Pose pose = StandingPerson(0);
  pose.x_in_world.col(4).setConstant(std::numeric_limits<double>::quiet_NaN());
  const ProjectedBody body = ProjectBody({{0, pose}}, FrontCamera());
  EXPECT_EQ(body.joints_px.size(), 18u);
  for (const BodyCapsule& limb : body.limbs) EXPECT_TRUE(limb.a_px.allFinite() && limb.b_px.allFinite());
  pose.x_in_world.setConstant(std::numeric_limits<double>::infinity());
  EXPECT_TRUE(ProjectBody({{0, pose}}, FrontCamera()).empty());
}

TEST(Masks, BodyFromKeypointsIsTheProjectedBody) {
  const geometry::RigCamera camera = FrontCamera();
  const Coco19Pose pose = StandingPerson(0.2);
  Person2d person;
  for (int j = 0; j < 19; ++j) {
    const auto p = geometry::Project(camera.camera, camera.cam_from_world * pose.x_in_world.col(j));
    person.keypoints.push_back({p.px.x(), p.px.y(), 1});
  }
  const Image a = BodyRegion(BodyFromKeypoints({person}, geometry::Coco19()), 320, 320, 0);
  const Image b = BodyRegion(ProjectBody({{0, pose}}, camera), 320, 320, 0);
  EXPECT_GT(Iou(a, b), 0.8);
  for (Keypoint2d& k : person.keypoints) k.x_px = std::nan("");
  EXPECT_TRUE(BodyFromKeypoints({person}, geometry::Coco19()).empty());
}

TEST(Masks, FlickerCountsChangesWhereNothingMoves) {
  const Image grey(20, 20, 3, 100);
  Image before(20, 20, 1, 0), after = before, moved = grey;
  *after.Pixel(3, 3) = 255;
  Flicker flicker;
  flicker.Add(grey, before, grey, after);
  EXPECT_DOUBLE_EQ(flicker.Share(), 1.0 / 400);
  moved.Pixel(3, 3)[1] = 200;
  Flicker moving;
  moving.Add(grey, before, moved, after);
  EXPECT_EQ(moving.changed_px, 0);
}

TEST(Masks, ColourMixtureIsADensity) {
  Rng rng(3);
  Eigen::Matrix3Xf colours(3, 4000);
  for (Eigen::Index i = 0; i < colours.cols(); ++i) {
    const double base = i % 2 ? 60 : 180;
    for (int k = 0; k < 3; ++k) colours(k, i) = static_cast<float>(base + 10 * rng.Normal());
  }
  const ColourMixture mixture = FitColours(colours, 2);
  double mass = 0;
  for (int r = 0; r < 256; r += 4) {
    for (int g = 0; g < 256; g += 4) {
      for (int b = 0; b < 256; b += 4) mass += 64 * std::exp(-mixture.Cost({double(r), double(g), double(b)}));
    }
  }
  EXPECT_NEAR(mass, 1.02, 0.01);  // the uniform share comes on top
  EXPECT_LT(mixture.Cost({60, 60, 60}), mixture.Cost({120, 120, 120}));
}

}  // namespace
}  // namespace mvstudio::dataset
