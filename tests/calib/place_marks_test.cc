#include "calib/keypoints/place_marks.h"

#include "geometry/rig/alignment.h"
#include "tests/calib/keypoint_support.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

struct Room {
  geometry::Rig truth;
  ScenePoints marks;
  Eigen::Matrix3Xd places;

  Room(int num_cameras, int num_points, double noise_px, uint64_t seed, double depth_m = 1.5)
      : truth(testing::PeopleRig(std::max(num_cameras, 5))) {
    truth.cameras.resize(static_cast<size_t>(num_cameras));
    Rng rng(seed);
    places.resize(3, num_points);
    for (int p = 0; p < num_points; ++p) {
      places.col(p) << rng.Uniform(-1.2, 1.2), rng.Uniform(-1.2, 1.2), depth_m * rng.Uniform(-0.5, 0.5);
      marks.names.push_back("p" + std::to_string(p));
    }
    marks.x_in_world.setConstant(3, num_points, NAN);
    for (int c = 0; c < num_cameras; ++c) {
      const geometry::RigCamera& camera = truth.cameras[static_cast<size_t>(c)];
      marks.cameras.push_back(camera.camera.name);
      for (int p = 0; p < num_points; ++p) {
        const auto seen = geometry::Project(camera.camera, camera.cam_from_world * Eigen::Vector3d(places.col(p)));
        const Eigen::Vector2d noise(rng.Normal(), rng.Normal());
        if (seen.status == Status::kOk && geometry::InImage(camera.camera, seen.px))
          marks.clicks.push_back({c, p, seen.px + noise_px * noise});
      }
    }
  }

  geometry::Rig Lenses() const {
    geometry::Rig lenses = truth;
    for (geometry::RigCamera& camera : lenses.cameras) camera.cam_from_world = {};
    return lenses;
  }
};

/// Largest turn and move of the cameras, once both rigs have one size and place.
geometry::RigDifference Off(const MarkedRig& placed, const Room& room) {
  Eigen::Matrix3Xd found(3, static_cast<Eigen::Index>(placed.points.size())), wanted = found;
  Eigen::Index i = 0;
  for (const auto& [name, x] : placed.points) {
    found.col(i) = x;
    wanted.col(i++) = room.places.col(std::stoi(name.substr(1)));
  }
  const geometry::Alignment to = geometry::AlignPoints(found, wanted, true);
  return geometry::CompareRigs(geometry::InWorld(placed.rig, to.b_from_a, to.scale), room.truth);
}

TEST(PlaceFromMarks, ExactClicksGiveTheExactRig) {
  for (const auto& [cameras, points] : {std::pair(2, 12), {3, 8}, {4, 10}, {6, 20}}) {
    const Room room(cameras, points, 1e-4, 3);
    const MarkedRig placed = PlaceFromMarks(room.Lenses(), room.marks, 1);
    ASSERT_EQ(placed.status, Status::kOk) << cameras << " cameras: " << placed.message;
    EXPECT_TRUE(placed.gross.empty());
    EXPECT_LT(Off(placed, room).max_rotation_rad, 1e-4) << cameras;
    EXPECT_LT(Off(placed, room).max_translation_m, 1e-3) << cameras;
  }
}

TEST(PlaceFromMarks, ClicksOfAPixelGiveAStart) {
  for (const auto& [cameras, points] : {std::pair(3, 10), {4, 12}, {6, 20}}) {
    const Room room(cameras, points, 1, 5);
    const MarkedRig placed = PlaceFromMarks(room.Lenses(), room.marks, 1);
    ASSERT_EQ(placed.status, Status::kOk) << cameras << " cameras: " << placed.message;
    EXPECT_LT(Off(placed, room).max_rotation_rad, 0.015) << cameras;
    EXPECT_LT(Off(placed, room).max_translation_m, 0.08) << cameras;
  }
}

TEST(PlaceFromMarks, WrongClicksAreNamed) {
  Room room(4, 14, 0.5, 7);
  std::vector<std::string> wrong;
  for (const size_t i : {2u, 20u, 33u}) {
    room.marks.clicks[i].px += Eigen::Vector2d(70, -50);
    const PointClick& click = room.marks.clicks[i];
    wrong.push_back(room.marks.names[static_cast<size_t>(click.point_idx)] + " in " +
                    room.marks.cameras[static_cast<size_t>(click.camera_idx)] + ":");
  }
  const MarkedRig placed = PlaceFromMarks(room.Lenses(), room.marks, 1);
  ASSERT_EQ(placed.status, Status::kOk) << placed.message;
  EXPECT_EQ(placed.gross.size(), wrong.size());
  for (const std::string& name : wrong) EXPECT_THAT(placed.gross, ::testing::Contains(::testing::StartsWith(name)));
  EXPECT_LT(Off(placed, room).max_rotation_rad, 0.01);
}

TEST(PlaceFromMarks, WhatClicksDoNotSayIsRefused) {
  const Room few(3, 5, 0.5, 1);
  const MarkedRig none = PlaceFromMarks(few.Lenses(), few.marks, 1);
  EXPECT_EQ(none.status, Status::kTooFewViews);
  EXPECT_THAT(none.message, HasSubstr("no two cameras share six marks"));

  const Room six(2, 6, 0.5, 1);
  EXPECT_NE(PlaceFromMarks(six.Lenses(), six.marks, 1).status, Status::kOk);

  Room alone(3, 10, 0.5, 1);
  auto& clicks = alone.marks.clicks;
  clicks.erase(
      std::remove_if(clicks.begin(), clicks.end(), [](const PointClick& c) { return c.camera_idx == 2 && c.point_idx > 3; }),
      clicks.end());
  const MarkedRig left = PlaceFromMarks(alone.Lenses(), alone.marks, 1);
  EXPECT_EQ(left.status, Status::kTooFewViews);
  EXPECT_THAT(left.message, HasSubstr("camera cam2"));

  EXPECT_THROW(PlaceFromMarks(testing::PeopleRig(1), alone.marks, 1), UsageError);
}

/// Marks of a floor: right, or refused, but never a rig that is turned over.
TEST(PlaceFromMarks, MarksInOnePlaneAreRightOrRefused) {
  for (const uint64_t seed : {1, 2, 3, 4}) {
    for (const int cameras : {2, 4}) {
      const Room room(cameras, 14, 1, seed, 0);
      const MarkedRig placed = PlaceFromMarks(room.Lenses(), room.marks, 1);
      if (placed.status == Status::kOk) {
        EXPECT_LT(Off(placed, room).max_rotation_rad, 0.05) << seed << ", " << cameras;
      } else {
        EXPECT_FALSE(placed.message.empty());
      }
    }
  }
}

}  // namespace
}  // namespace mvstudio::calib
