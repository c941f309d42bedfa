#include "calib/keypoints/place.h"
#include "geometry/rig/alignment.h"
#include "tests/calib/keypoint_support.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

geometry::Rig WithoutPoses(geometry::Rig rig) {
  for (geometry::RigCamera& camera : rig.cameras) camera.cam_from_world = {};
  return rig;
}

/// Lengths between some joints of FilmPeople's body, by a rig that knows them.
std::vector<KnownLength> Lengths(const testing::PeopleOptions& options) {
  Rng rng(options.seed);
  const Eigen::Matrix3Xd body = [&] {
    Eigen::Matrix3Xd b = Eigen::Matrix3Xd::NullaryExpr(3, options.num_joints, [&] { return rng.Uniform(-1, 1); });
    b.topRows<2>() *= 0.25, b.row(2) *= 0.8;
    return b;
  }();
  std::vector<KnownLength> lengths;
  for (const auto& [a, b] : {std::pair(0, 1), std::pair(2, 3), std::pair(4, 5)})
    lengths.push_back({{a, b}, (body.col(a) - body.col(b)).norm()});
  return lengths;
}

TEST(PlaceFromKeypoints, CamerasComeOutWhereTheyAre) {
  for (const int cameras : {2, 4, 8}) {
    const geometry::Rig truth = PeopleRig(cameras);
    testing::PeopleOptions options;
    options.num_frames = 60;
    const PlacedRig placed = PlaceFromKeypoints(WithoutPoses(truth), FilmPeople(truth, options), Lengths(options), 0.3);
    ASSERT_EQ(placed.status, Status::kOk) << placed.message;
    EXPECT_LT(placed.length_spread, 0.02);
    EXPECT_GT(placed.inlier_share, 0.8);
    const geometry::Rigid3 first_from_world = truth.cameras[0].cam_from_world;
    for (size_t c = 0; c < truth.cameras.size(); ++c) {
      const geometry::Rigid3 wanted = truth.cameras[c].cam_from_world * geometry::Inverse(first_from_world);
      const geometry::Rigid3& found = placed.rig.cameras[c].cam_from_world;
      EXPECT_LT(geometry::RotationAngle(found.rotation, wanted.rotation), 0.06) << cameras << " " << c;
      EXPECT_LT((geometry::Inverse(found).translation - geometry::Inverse(wanted).translation).norm(), 0.3)
          << cameras << " " << c;
    }
  }
}

/// Cameras that are off by far more than an adjustment mends: by the others' points, and all anew.
TEST(PlaceFromKeypoints, CamerasFarOffArePlacedByTheOthers) {
  const geometry::Rig truth = PeopleRig(5);
  testing::PeopleOptions options;
  options.num_joints = 1, options.num_frames = 150;
  const std::vector<KeypointJoint> joints = testing::JointsOf(truth, FilmPeople(truth, options));
  geometry::Rig off = truth;
  testing::Bump({0.6, -0.4, 0.3}, {1, 1, 0}, &off.cameras[1]);
  testing::Bump({0, 0.8, 0.3}, {0, -1, 0.5}, &off.cameras[4]);
  const auto mended = PlaceByOthers(off, joints, {1, 4});
  ASSERT_TRUE(mended);
  for (size_t c = 0; c < truth.cameras.size(); ++c) {
    EXPECT_LT(geometry::RotationAngle(mended->cameras[c].cam_from_world.rotation, truth.cameras[c].cam_from_world.rotation),
              0.03);
    EXPECT_LT((mended->cameras[c].CenterInWorld() - truth.cameras[c].CenterInWorld()).norm(), 0.15);
  }
  EXPECT_FALSE(PlaceByOthers(off, joints, {0, 1, 2, 4})) << "one camera has no points";
  const auto anew = PlaceAnew(off, joints);
  ASSERT_TRUE(anew);
  Eigen::Matrix3Xd found(3, 5), wanted(3, 5);
  for (int c = 0; c < 5; ++c) found.col(c) = anew->cameras[c].CenterInWorld(), wanted.col(c) = truth.cameras[c].CenterInWorld();
  EXPECT_LT(geometry::AlignPoints(found, wanted, true).rms, 0.3);
}

/// Two cameras: how many joints and frames they share, and what is missing.
TEST(PlaceFromKeypoints, TwoCamerasAreToldWhatTheyLack) {
  const geometry::Rig truth = PeopleRig(2);
  testing::PeopleOptions options;
  const std::vector<triangulate::DetectedFrame> frames = FilmPeople(truth, options);
  const auto place = [&](const std::vector<triangulate::DetectedFrame>& some) {
    return PlaceFromKeypoints(WithoutPoses(truth), some, Lengths(options), 0.3);
  };
  const PlacedRig few = place({frames[0], frames[1]});
  EXPECT_EQ(few.status, Status::kTooFewViews);
  EXPECT_THAT(few.message, HasSubstr("cameras cam0 and cam1 see "));
  EXPECT_THAT(few.message, HasSubstr("in 2 frames; at least 30 are needed"));
  std::vector<triangulate::DetectedFrame> alternating = frames;
  for (size_t f = 0; f < frames.size(); ++f) alternating[f].people[f % 2].clear();
  EXPECT_THAT(place(alternating).message, HasSubstr("no two cameras see a joint at once"));
  std::vector<triangulate::DetectedFrame> apart = frames;
  for (size_t f = 0; f < frames.size(); ++f) apart[f].people[1] = frames[(f + 17) % frames.size()].people[1];
  const PlacedRig late = place(apart);
  if (late.status == Status::kTooFewViews) {
    EXPECT_THAT(late.message, HasSubstr("are they synchronous"));
  }
}

TEST(PlaceFromKeypoints, WhatCannotBePlacedIsSaid) {
  const geometry::Rig truth = PeopleRig(3);
  testing::PeopleOptions options;
  std::vector<triangulate::DetectedFrame> frames = FilmPeople(truth, options);
  EXPECT_EQ(PlaceFromKeypoints(WithoutPoses(truth), frames, {}, 0.3).status, Status::kDegenerate) << "no length";
  for (triangulate::DetectedFrame& frame : frames) frame.people[2].clear();
  const PlacedRig blind = PlaceFromKeypoints(WithoutPoses(truth), frames, Lengths(options), 0.3);
  EXPECT_EQ(blind.status, Status::kTooFewViews);
  EXPECT_THAT(blind.message, HasSubstr("cam2 cannot be placed: it shares 0 joints"));
  EXPECT_EQ(PlaceFromKeypoints(WithoutPoses(truth), {}, Lengths(options), 0.3).status, Status::kTooFewViews);
  Rng rng(5);
  for (triangulate::DetectedFrame& frame : frames) {
    for (auto& people : frame.people) {
      for (auto& person : people) {
        for (auto& key : person) key.px = {rng.Uniform(0, 1279), rng.Uniform(0, 959)};
      }
    }
  }
  EXPECT_NE(PlaceFromKeypoints(WithoutPoses(truth), frames, Lengths(options), 0.3).status, Status::kOk) << "noise alone";
}

}  // namespace
}  // namespace mvstudio::calib
