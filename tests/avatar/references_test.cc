#include "avatar/run/references/references.h"

#include <ATen/ATen.h>

#include <cmath>

#include "avatar/data/safetensors.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

constexpr int kSize = 33;

/// A square of 1 m in x and y at z = 0, two triangles, seen from -z; a second one of 0.2 m before its middle where asked for.
body::BodyTemplate Squares(bool with_second) {
  body::BodyTemplate body;
  body.vertices.resize(3, with_second ? 8 : 4), body.faces.resize(3, with_second ? 4 : 2);
  for (int s = 0; s < (with_second ? 2 : 1); ++s) {
    const float half = s == 0 ? 0.5f : 0.1f, z = s == 0 ? 0.f : -1.f;
    body.vertices.middleCols<4>(4 * s) << -half, half, half, -half, -half, -half, half, half, z, z, z, z;
    body.faces.middleCols<2>(2 * s) << 4 * s, 4 * s, 4 * s + 2, 4 * s + 3, 4 * s + 1, 4 * s + 2;
  }
  body.face_part.assign(static_cast<size_t>(body.faces.cols()), 1);
  body.face_uv = Eigen::Matrix2Xf::Constant(2, 3 * body.faces.cols(), 0.5f);
  return body;
}

/// Looks along z from (x, 0, -2); a metre at the square is 16 px.
geometry::RigCamera CameraAt(double x) {
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("cam", kSize, kSize, 32);
  camera.cam_from_world.translation = Eigen::Vector3d(-x, 0, 2);
  return camera;
}

/// An image whose red is 4 x and green 3 y, all person.
ReferenceView ViewOf(const body::BodyTemplate& body, const geometry::RigCamera& camera, int frame) {
  ReferenceView view;
  view.camera = "cam", view.frame = frame, view.crop = camera;
  view.vertices = std::make_shared<const Eigen::Matrix3Xf>(body.vertices);
  view.image = Image(kSize, kSize, 3), view.mask = Image(kSize, kSize, 1, 255);
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize; ++x)
      view.image.Pixel(x, y)[0] = static_cast<uint8_t>(4 * x), view.image.Pixel(x, y)[1] = static_cast<uint8_t>(3 * y);
  return view;
}

struct Warped {
  std::vector<uint8_t> pixels = std::vector<uint8_t>(4 * kSize * kSize);
  int At(int channel, int x, int y) const { return pixels[static_cast<size_t>((channel * kSize + y) * kSize + x)]; }
};

Warped Warp(const References& references, const geometry::RigCamera& target) {
  Warped out;
  std::vector<size_t> all(references.views().size());
  for (size_t v = 0; v < all.size(); ++v) all[v] = v;
  WarpReferences(references, all, body::RasterizeFaces(references.body(), references.body().vertices, target),
                 out.pixels.data());
  return out;
}

TEST(References, TheSameViewGivesTheImageBack) {
  const body::BodyTemplate body = Squares(true);
  const References references({ViewOf(body, CameraAt(0), 0)}, body, 1);
  const Warped warped = Warp(references, CameraAt(0));
  const body::FaceMap surface = body::RasterizeFaces(body, body.vertices, CameraAt(0));
  int seen = 0, differ = 0;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const bool on_body = surface.face[static_cast<size_t>(y) * kSize + x] >= 0;
      ASSERT_EQ(warped.At(3, x, y), on_body ? 255 : 0) << x << " " << y;
      seen += on_body;
      differ += on_body && (warped.At(0, x, y) != 4 * x || warped.At(1, x, y) != 3 * y || warped.At(2, x, y) != 0);
    }
  }
  EXPECT_EQ(seen, 17 * 17) << "a metre is 16 px, and both edges lie on pixel centres";
  EXPECT_EQ(differ, 0);
}

TEST(References, AnotherViewMovesAPlaneByItsDisparity) {
  // A camera b to the right sees the plane at depth 2 m moved by 32 b / 2 px to the left.
  const body::BodyTemplate body = Squares(false);
  const References references({ViewOf(body, CameraAt(0.25), 0)}, body, 1);
  const Warped warped = Warp(references, CameraAt(0));
  for (const int x : {9, 16, 24})
    for (const int y : {8, 16, 24}) {
      ASSERT_EQ(warped.At(3, x, y), 255);
      EXPECT_EQ(warped.At(0, x, y), 4 * (x - 4)) << x;
      EXPECT_EQ(warped.At(1, x, y), 3 * y);
    }
}

TEST(References, WhatTheSourceDoesNotSeeIsInvalid) {
  const body::BodyTemplate body = Squares(true);
  // From x = 0.25 the small square, at 1 m, hides what lies behind it, at other places than from the front. The lines from the
  // camera over its edges at -0.1 and 0.1 m meet the large one at -0.45 and -0.05 m.
  const References references({ViewOf(body, CameraAt(0.25), 0)}, body, 1);
  const Warped warped = Warp(references, CameraAt(0));
  int hidden = 0;
  for (int x = 8; x <= 24; ++x) {
    const double x_m = (x - 16) / 16.0;
    if (std::abs(x_m) < 0.21 || std::abs(x_m + 0.45) < 0.06) continue;  // the target sees the small square itself; an edge
    EXPECT_EQ(warped.At(3, x, 16), x_m > -0.45 && x_m < -0.05 ? 0 : 255) << x;
    hidden += x_m > -0.45 && x_m < -0.05;
  }
  EXPECT_EQ(hidden, 3);
  // Far from its row nothing is hidden.
  for (int x = 8; x <= 24; ++x) EXPECT_EQ(warped.At(3, x, 10), 255) << x;
  ReferenceView view = ViewOf(body, CameraAt(0), 0);
  view.mask = Image(kSize, kSize, 1);
  EXPECT_EQ(Warp(References({view}, body, 1), CameraAt(0)).At(3, 16, 16), 0) << "outside the mask";
  EXPECT_EQ(Warp(References({ViewOf(body, CameraAt(1.5), 0)}, body, 1), CameraAt(0)).At(3, 9, 16), 0) << "outside the image";
}

TEST(References, BehindTheCameraFromBehindAndGrazingAreInvalid) {
  const body::BodyTemplate body = Squares(false);
  const auto valid = [&](const geometry::RigCamera& source) {
    const Warped warped = Warp(References({ViewOf(body, source, 0)}, body, 1), CameraAt(0));
    int count = 0;
    for (int p = 0; p < kSize * kSize; ++p) count += warped.pixels[static_cast<size_t>(3 * kSize * kSize + p)] > 0;
    return count;
  };
  EXPECT_EQ(valid(CameraAt(0)), 17 * 17);
  geometry::RigCamera beyond = CameraAt(0);
  beyond.cam_from_world.translation.z() = -2;  // the square lies behind it
  EXPECT_EQ(valid(beyond), 0);
  geometry::RigCamera back = CameraAt(0);
  back.cam_from_world.rotation = Eigen::AngleAxisd(3.14159265358979, Eigen::Vector3d::UnitY());
  EXPECT_EQ(valid(back), 0) << "the surface's other side";
  geometry::RigCamera flat = CameraAt(0);
  flat.cam_from_world.rotation = Eigen::AngleAxisd(1.45, Eigen::Vector3d::UnitY());
  EXPECT_EQ(valid(flat), 0) << "83 degrees";
  flat.cam_from_world.rotation = Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitY());
  EXPECT_GT(valid(flat), 100);
}

TEST(References, TwoViewsAreAveragedByTheirCosines) {
  const body::BodyTemplate body = Squares(false);
  ReferenceView front = ViewOf(body, CameraAt(0), 0), side = ViewOf(body, CameraAt(0), 1);
  front.image = Image(kSize, kSize, 3, 200), side.image = Image(kSize, kSize, 3, 100);
  side.crop.cam_from_world.rotation = Eigen::AngleAxisd(3.14159265358979 / 3, Eigen::Vector3d::UnitY());
  const Warped warped = Warp(References({front, side}, body, 1), CameraAt(0));
  // At the middle, which both axes hit: cosines 1 and 1/2.
  EXPECT_EQ(warped.At(0, 16, 16), std::lround((200 + 0.5 * 100) / 1.5));
}

ModelOptions Options(int count, ReferenceChoice choice = ReferenceChoice::kBest, int gap = 0) {
  ModelOptions o;
  o.method = Method::kHf, o.prior = Prior::kTemplate;
  o.references = count, o.reference_choice = choice, o.reference_gap = gap;
  return o;
}

std::vector<size_t> Choose(const References& references, std::optional<int> frame, const ModelOptions& options) {
  const ReferenceTarget target{CameraAt(0), references.body().vertices, frame};
  return ChooseReferences(references, target, body::RasterizeFaces(references.body(), target.vertices, target.crop), options);
}

TEST(ChooseReferences, NeverTakesTheTimeStepOfTheTarget) {
  // The two best views are of the target's own frame: seen from where the target is, in its pose.
  const body::BodyTemplate body = Squares(false);
  const References references({ViewOf(body, CameraAt(0), 7), ViewOf(body, CameraAt(0.01), 7), ViewOf(body, CameraAt(0.4), 3)},
                              body, 1);
  EXPECT_THAT(Choose(references, 5, Options(1)), ElementsAre(0)) << "they would be taken for another frame";
  EXPECT_THAT(Choose(references, 7, Options(3)), ElementsAre(2));
  EXPECT_THAT(Choose(references, 7, Options(2, ReferenceChoice::kFrontBack)), ElementsAre(2));
  EXPECT_THAT(Choose(references, std::nullopt, Options(1)), ElementsAre(0)) << "of another take";
  EXPECT_THAT(Choose(references, 8, Options(3, ReferenceChoice::kBest, 1)), ElementsAre(2)) << "within the gap";
  EXPECT_THAT(Choose(references, 5, Options(3, ReferenceChoice::kBest, 2)), IsEmpty()) << "no reference is left";
  const References one({ViewOf(body, CameraAt(0), 7)}, body, 1);
  EXPECT_THAT(Choose(one, 7, Options(4)), IsEmpty());
  at::Tensor row = at::full({1, 4, kSize, kSize}, 9, at::kByte);
  FillReferenceRow(one, {CameraAt(0), body.vertices, 7}, Options(4), 0, row);
  EXPECT_EQ(row.count_nonzero().item<int64_t>(), 0) << "black, and nowhere valid";
}

TEST(ChooseReferences, TakesNearPosesAndWhatOthersDoNotShow) {
  body::BodyTemplate body = Squares(false);
  ReferenceView bent = ViewOf(body, CameraAt(0), 1);
  Eigen::Matrix3Xf moved = body.vertices;
  moved(2, 0) -= 0.4f, moved(2, 2) -= 0.4f;  // no rigid motion does this
  bent.vertices = std::make_shared<const Eigen::Matrix3Xf>(moved);
  EXPECT_THAT(Choose(References({bent, ViewOf(body, CameraAt(0.1), 2)}, body, 1), 0, Options(1)), ElementsAre(1));
  // One view shows the left half alone, another the same half, the third the right one.
  const auto half = [&](bool left, int frame) {
    ReferenceView view = ViewOf(body, CameraAt(0), frame);
    for (int y = 0; y < kSize; ++y)
      for (int x = 0; x < kSize; ++x) *view.mask.Pixel(x, y) = (x <= 17) == left ? 255 : 0;
    return view;
  };
  const References halves({half(true, 1), half(true, 2), half(false, 3)}, body, 1);
  EXPECT_THAT(Choose(halves, 0, Options(2)), ElementsAre(0, 2));
  EXPECT_THAT(Choose(halves, 0, Options(3)), ElementsAre(0, 2)) << "the second shows nothing more";
}

TEST(ReferenceViews, AreTheSameBytesAfterWritingAndReading) {
  const testing::TempDir folder;
  const std::string path = folder / "references.safetensors";
  const body::BodyTemplate body = Squares(true);
  geometry::RigCamera rotated = CameraAt(0.3);
  rotated.cam_from_world.rotation = geometry::RotationExp({0.1, 0.7, -0.2});
  const std::vector<ReferenceView> views = {ViewOf(body, CameraAt(0), 4), ViewOf(body, rotated, 9)};
  DatasetSplit split;
  split.train_cameras = {"cam"}, split.train_frames = {4, 9};
  WriteReferenceViews(views, path);
  const std::vector<ReferenceView> read = ReadReferenceViews(path, split, 8);
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[1].frame, 9);
  EXPECT_EQ(read[1].image.pixels, views[1].image.pixels);
  EXPECT_EQ(*read[1].vertices, *views[1].vertices);
  EXPECT_EQ(read[1].crop.cam_from_world.translation, rotated.cam_from_world.translation);
  WriteReferenceViews(read, folder / "again");
  EXPECT_EQ(ReadFile(folder / "again"), ReadFile(path));
}

TEST(ReferenceViews, OfOtherSplitsBodiesAndDamagedFilesAreRefused) {
  const testing::TempDir folder;
  const std::string path = folder / "references.safetensors";
  const body::BodyTemplate body = Squares(false);
  WriteReferenceViews({ViewOf(body, CameraAt(0), 4)}, path);
  DatasetSplit split;
  split.train_cameras = {"cam"}, split.train_frames = {4};
  EXPECT_NO_THROW(ReadReferenceViews(path, split, 4));
  const auto refusal = [&](const DatasetSplit& of, int64_t vertices) {
    return MessageOf<FormatError>([&] { ReadReferenceViews(path, of, vertices); });
  };
  EXPECT_THAT(refusal(split, 5), HasSubstr("vertices"));
  DatasetSplit other = split;
  other.train_frames = {3};
  EXPECT_THAT(refusal(other, 4), HasSubstr("frame 4 was not trained on"));
  other = split, other.train_cameras = {"00_01"};
  EXPECT_THAT(refusal(other, 4), HasSubstr("camera cam was not trained on"));
  const TensorFile good = ReadTensorFile(path);
  const auto damaged = [&](const std::string& name, const at::Tensor& value) {
    TensorFile bad = good;
    bad.tensors[name] = value;
    if (!value.defined()) bad.tensors.erase(name);
    WriteTensorFile(bad, path);
    return refusal(split, 4);
  };
  EXPECT_THAT(damaged("masks", {}), HasSubstr("masks"));
  EXPECT_THAT(damaged("images", at::zeros({1, 3, 4, 5}, at::kByte)), HasSubstr("images"));
  EXPECT_THAT(damaged("vertices", at::full({1, 4, 3}, std::nan(""), at::kFloat)), HasSubstr("vertices"));
  EXPECT_THAT(damaged("cameras", at::zeros({1, 11}, at::kDouble)), HasSubstr("cameras"));
  TensorFile bad = good;
  bad.metadata["camera_names"] = "";
  WriteTensorFile(bad, path);
  EXPECT_THAT(refusal(split, 4), HasSubstr("camera_names"));
  bad.metadata["format"] = "mvstudio.avatar/1";
  WriteTensorFile(bad, path);
  EXPECT_THAT(refusal(split, 4), HasSubstr("format"));
  WriteFileAtomic(path, ReadFile(path).substr(0, 300));
  EXPECT_THROW(ReadReferenceViews(path, split, 4), FormatError);
}

}  // namespace
}  // namespace mvstudio::avatar
