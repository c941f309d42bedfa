#include "dataset/masks.h"

#include <numeric>

#include "core/error.h"
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
  for (size_t f = 0; f < scene.frames.size(); ++f)
    sum += Iou(SegmentBody(scene.frames[f], scene.bodies[f], model).mask, scene.truth[f]);
  return sum / static_cast<double>(scene.frames.size());
}

TEST(Masks, WalkingPersonIsCutOut) {
  const Scene scene = MakeScene(0.12, 0);
  const CameraMaskModel model = LearnCamera(scene.frames, scene.bodies, nullptr);
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
  const Scene scene = MakeScene(0.12, 0);
  const CameraMaskModel model = LearnCamera(scene.frames, scene.bodies, nullptr);
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
  const Scene scene = MakeScene(0.12, 0);
  const CameraMaskModel model = LearnCamera(scene.frames, scene.bodies, nullptr);
  const BodyMask mask = SegmentBody(scene.frames[0], ProjectedBody{}, model);
  EXPECT_EQ(std::accumulate(mask.mask.pixels.begin(), mask.mask.pixels.end(), 0), 0);
  EXPECT_EQ(mask.joints, 0);
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
