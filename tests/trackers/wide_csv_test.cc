#include <cmath>
#include <fstream>

#include "core/disk/npy_write.h"
#include "core/error.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"
#include "tests/trackers/support.h"

/// Tables with a row a frame, as people write them with pandas from MediaPipe and others.
namespace mvstudio::dataset {
namespace {

class WideCsv : public ::testing::Test {
 protected:
  TrackedPoints Read(const std::string& text) const {
    std::ofstream(folder_ / "a.csv") << text;
    return ReadTrackerFile(folder_ / "a.csv", "cam1");
  }
  testing::TempDir folder_;
};

TEST_F(WideCsv, JointsScoresAndFramesAreThoseOfTheColumns) {
  const TrackedPoints points = Read(
      "frame,person_score,nose_x,nose_y,nose_conf,left_hip_x,left_hip_y,left_hip_conf\n"
      "7,0.9,10.5,20,0.75,30,40,0.5\n9,0.9,11,21,1,,,\n");
  EXPECT_THAT(points.joints, ElementsAre("nose", "left_hip"));
  ASSERT_EQ(points.track.frames.size(), 2u);
  const Person2d& first = points.track.frames.at(7).at(0);
  EXPECT_EQ(first.keypoints[0].x_px, 10.5);
  EXPECT_EQ(first.keypoints[0].score, 0.75);
  EXPECT_EQ(first.keypoints[1].y_px, 40);
  EXPECT_EQ(points.track.frames.at(9).at(0).keypoints[1].score, 0) << "not detected";
}

TEST_F(WideCsv, RowsCountFrames) {
  const TrackedPoints points = Read("nose.x,nose.y,hip.x,hip.y\n1,2,3,4\n5,6,7,8\n");
  EXPECT_EQ(points.track.frames.at(1).at(0).keypoints[1].x_px, 7);
  EXPECT_EQ(points.track.frames.at(1).at(0).keypoints[1].score, 1);
}

/// 30 Hz in rounded milliseconds: frame k is at k / 30 s, and a frame without a row stays a gap.
TEST_F(WideCsv, TimesGiveFramesWhereNoColumnDoes) {
  std::string text = "time_ms,nose_x,nose_y\n";
  for (int frame = 3; frame < 900; ++frame) {
    if (frame % 7 == 5) continue;
    text += std::to_string((frame * 1000 + 15) / 30) + "," + std::to_string(frame) + ",2\n";
  }
  const TrackedPoints points = Read(text);
  EXPECT_NEAR(points.time_step, 1000 / 30.0, 0.01);
  EXPECT_EQ(points.track.frames.count(5), 0u);
  for (const auto& [frame, people] : points.track.frames) EXPECT_EQ(people.at(0).keypoints[0].x_px, frame);
  const TrackedPoints indexed = Read(",time,nose_x,nose_y\n0,0,1,2\n1,0.1,1,2\n2,0.4,9,2\n3,0.5,1,2\n");
  EXPECT_EQ(indexed.track.frames.at(4).at(0).keypoints[0].x_px, 9) << "an index that counts rows skips no frame";
  const TrackedPoints kept = Read("frame,time,nose_x,nose_y\n0,0,1,2\n1,0.1,1,2\n2,0.4,9,2\n");
  EXPECT_EQ(kept.track.frames.at(2).at(0).keypoints[0].x_px, 9) << "frames are as the file says";
}

TEST_F(WideCsv, TimesThatTellNoFramesAreRefused) {
  const auto message = [&](const std::string& text) { return testing::MessageOf<FormatError>([&] { Read(text); }); };
  EXPECT_THAT(message("time,nose_x,nose_y\n0,1,2\n1,1,2\n2,1,2\n3.5,1,2\n"), HasSubstr("no multiple"));
  EXPECT_THAT(message("time,nose_x,nose_y\n0,1,2\n2,1,2\n1,1,2\n"), HasSubstr("comes after"));
  EXPECT_THAT(message("timestamp,nose_x,nose_y\n1700000000.0,1,2\n1700000000.1,1,2\n1700000000.2,1,2\n"),
              HasSubstr("recording's start"));
}

TEST_F(WideCsv, TheCornerWithoutAScoreIsNotSeen) {
  const auto frames = Read("frame,nose_x,nose_y,hip_x,hip_y\n0,0,0,3,4\n1,-1,-1,3,4\n2,0,7,3,4\n").track.frames;
  EXPECT_EQ(frames.at(0).at(0).keypoints[0].score, 0);
  EXPECT_EQ(frames.at(1).at(0).keypoints[0].score, 0);
  EXPECT_EQ(frames.at(2).at(0).keypoints[0].score, 1);
  EXPECT_EQ(Read("frame,nose_x,nose_y,nose_score\n0,0,0,0.9\n").track.frames.at(0).at(0).keypoints[0].score, 0.9);
}

TEST_F(WideCsv, AColumnOfPeopleLetsAFrameHaveSeveral) {
  const TrackedPoints points = Read("frame,person_id,nose_x,nose_y\n4,0,1,2\n4,1,5,6\n5,1,7,8\n");
  ASSERT_EQ(points.track.frames.at(4).size(), 2u);
  EXPECT_EQ(points.track.frames.at(4)[1].keypoints[0].x_px, 5);
  EXPECT_THAT(testing::MessageOf<FormatError>([&] { Read("frame,nose_x,nose_y\n4,1,2\n4,5,6\n4,6,7\n4,6,8\n"); }),
              HasSubstr("no column person"));
  EXPECT_THAT(testing::MessageOf<FormatError>([&] { Read("camera,frame,nose_x,nose_y\na,4,1,2\nb,5,5,6\n"); }),
              HasSubstr("a table for each camera"));
}

TEST_F(WideCsv, DepthIsNoThirdCoordinateButPointsInSpaceAreRefused) {
  const TrackedPoints points = Read("frame,nose_x,nose_y,nose_z,nose_visibility\n0,10,20,-0.3,0.8\n");
  EXPECT_EQ(points.track.frames.at(0).at(0).keypoints[0].score, 0.8);
  const auto message = [&](const std::string& text) { return testing::MessageOf<FormatError>([&] { Read(text); }); };
  EXPECT_THAT(message("frame,nose_x,nose_y,nose_z\n0,10,20,30\n"), HasSubstr("3D points"));
  EXPECT_THAT(message("frame,nose_x,nose_y\n0,1k,2\n"), HasSubstr("`1k` is not a number"));
}

TEST_F(WideCsv, CamerasInNamesOfColumnsAreNoJoints) {
  const auto message = [&](const std::string& text) { return testing::MessageOf<FormatError>([&] { Read(text); }); };
  EXPECT_THAT(message("pt1_cam1_X,pt1_cam1_Y,pt1_cam2_X,pt1_cam2_Y\n1,2,3,4\n"), HasSubstr("several cameras"));
  EXPECT_THAT(message("nose_cam_1_x,nose_cam_1_y,nose_cam_2_x,nose_cam_2_y\n1,2,3,4\n"), HasSubstr("several cameras"));
  EXPECT_THAT(Read("pt1_cam1_X,pt1_cam1_Y,pt2_cam1_X,pt2_cam1_Y\n1,2,3,4\n").joints, ElementsAre("pt1_cam1", "pt2_cam1"));
}

TEST_F(WideCsv, TablesOfAllCamerasAreNone) {
  std::ofstream(folder_ / "b.csv") << "camera,frame,person,joint,x_px,y_px,score\nc1,0,0,nose,1,2,1\n";
  EXPECT_EQ(FindTrackerFormat(folder_ / "b.csv"), nullptr);
}

/// x_nose for nose_x; z beside a visibility is MediaPipe's depth. Columns of something else are no joints.
TEST_F(WideCsv, JointsBehindTheirCoordinates) {
  const TrackedPoints points = Read(
      "frame,x_nose,y_nose,z_nose,v_nose,x_left_hip,y_left_hip,z_left_hip,v_left_hip,x_neck,y_neck,z_neck,v_neck\n"
      "4,10,20,0.1,0.75,30,40,0.1,0.5,50,60,0.2,1\n");
  EXPECT_THAT(points.joints, ElementsAre("nose", "left_hip", "neck"));
  const Person2d& person = points.track.frames.at(4).at(0);
  EXPECT_EQ(person.keypoints[1].y_px, 40);
  EXPECT_EQ(person.keypoints[1].score, 0.5);
  std::ofstream(folder_ / "boxes.csv") << "frame,id,x_center,y_center,w,h\n1,2,3,4,5,6\n";
  EXPECT_EQ(FindTrackerFormat(folder_ / "boxes.csv"), nullptr);
}

/// A row a point, as people write MediaPipe's landmarks.
TEST_F(WideCsv, ARowAPoint) {
  std::string text = "frame,landmark_id,x,y,z,visibility\n";
  for (int frame = 2; frame < 4; ++frame) {
    for (int k = 0; k < 33; ++k)
      text += std::to_string(frame) + "," + std::to_string(k) + "," + std::to_string(10 * k) + ",5,0.1,0.9\n";
  }
  const TrackedPoints numbered = Read(text);
  EXPECT_EQ(numbered.joints, geometry::SkeletonByName("mediapipe33").joints);
  ASSERT_EQ(numbered.track.frames.size(), 2u);
  EXPECT_EQ(numbered.track.frames.at(3).at(0).keypoints[32].x_px, 320);
  EXPECT_EQ(numbered.track.camera, "cam1");

  const TrackedPoints named =
      Read("frame,person,landmark_name,landmark_id,x,y,score\n0,0,NOSE,0,1,2,0.5\n0,1,NOSE,0,3,4,0.25\n");
  EXPECT_THAT(named.joints, ElementsAre("NOSE"));
  EXPECT_EQ(named.track.frames.at(0).at(1).keypoints[0].score, 0.25);
  EXPECT_THAT(Read("frame,point,x,y\n0,7,1,2\n").joints, ElementsAre("point_7"));
  EXPECT_THAT(testing::MessageOf<FormatError>([&] { Read("frame,joint,x,y,z\n0,nose,1,2,3\n"); }), HasSubstr("3D points"));
  std::ofstream(folder_ / "all.csv") << "camera,frame,joint,x,y\na,0,nose,1,2\n";
  EXPECT_EQ(FindTrackerFormat(folder_ / "all.csv"), nullptr) << "all cameras' table is read as that";
}

/// 2 frames, 3 joints: x is 100 camera + 10 frame + joint, y 7.
std::vector<double> PixelsOf(int camera, bool scores) {
  std::vector<double> values;
  for (int frame = 0; frame < 2; ++frame) {
    for (int joint = 0; joint < 3; ++joint) {
      values.insert(values.end(), {100.0 * camera + 10 * frame + joint, 7.0});
      if (scores) values.push_back(0.5);
    }
  }
  return values;
}

TEST_F(WideCsv, ArraysOfOneCamera) {
  const auto write = [&](const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return ReadTrackerFile(folder_ / name, "cam1");
  };
  const auto x_of = [](const TrackedPoints& points, int frame, size_t person, size_t joint) {
    return points.track.frames.at(frame).at(person).keypoints[joint].x_px;
  };
  const TrackedPoints plain = write("a.npy", NpyOfDoubles({2, 3, 2}, PixelsOf(4, false)));
  EXPECT_THAT(plain.joints, ElementsAre("point_0", "point_1", "point_2"));
  EXPECT_EQ(x_of(plain, 1, 0, 2), 412);
  EXPECT_EQ(plain.track.frames.at(0).at(0).keypoints[0].score, 1);
  std::vector<double> gaps = PixelsOf(4, false);
  gaps[0] = gaps[1] = 0, gaps[2] = std::nan("");
  const TrackedPoints seen = write("b.npy", NpyOfDoubles({2, 3, 2}, gaps));
  EXPECT_EQ(seen.track.frames.at(0).at(0).keypoints[0].score, 0);
  EXPECT_EQ(seen.track.frames.at(0).at(0).keypoints[1].score, 0);
  const TrackedPoints scored = write("c.npz", NpzOf({{"kpts", NpyOfDoubles({2, 3, 3}, PixelsOf(4, true))},
                                                     {"joint_names", NpyOfTexts({"nose", "neck", "hip"})}}));
  EXPECT_THAT(scored.joints, ElementsAre("nose", "neck", "hip"));
  EXPECT_EQ(scored.track.frames.at(1).at(0).keypoints[1].score, 0.5);
  const TrackedPoints apart = write("d.npz", NpzOf({{"xy", NpyOfDoubles({2, 3, 2}, PixelsOf(4, false))},
                                                    {"conf", NpyOfDoubles({2, 3}, {.1, .2, .3, .4, .5, .6})}}));
  EXPECT_EQ(apart.track.frames.at(1).at(0).keypoints[2].score, 0.6);
  const TrackedPoints people = write("e.npy", NpyOfDoubles({1, 2, 3, 2}, PixelsOf(4, false)));
  EXPECT_EQ(x_of(people, 0, 1, 2), 412);
  const auto refused = [&](const std::string& bytes, const std::string& name) {
    return testing::MessageOf<FormatError>([&] { write(name, bytes); });
  };
  EXPECT_THAT(refused(NpyOfDoubles({3, 4}, std::vector<double>(12)), "g.npy"), HasSubstr("3 x 4"));
  EXPECT_THAT(refused(NpyOfDoubles({1, 21, 3, 2}, std::vector<double>(126)), "h.npy"), HasSubstr("cameras first"));
  EXPECT_THAT(refused(NpzOf({{"a", NpyOfDoubles({3}, {1, 2, 3})}}), "i.npz"), HasSubstr("its arrays: a 3"));

  // Scores are what is called so, whatever else has their shape; more frames than slots for people are people.
  const std::string xy = NpyOfDoubles({2, 3, 2}, PixelsOf(4, false)), score = NpyOfDoubles({2, 3}, {.1, .2, .3, .4, .5, .6});
  const std::string speed = NpyOfDoubles({2, 3}, std::vector<double>(6, 0.9));
  EXPECT_EQ(write("j.NPZ", NpzOf({{"keypoints", xy}, {"scores", score}, {"speed", speed}}))
                .track.frames.at(1)
                .at(0)
                .keypoints[2]
                .score,
            0.6);
  EXPECT_THAT(refused(NpzOf({{"keypoints", xy}, {"conf", score}, {"scores", speed}}), "k.npz"), HasSubstr("conf, scores"));
  EXPECT_EQ(write("l.npy", NpyOfDoubles({22, 21, 3, 2}, std::vector<double>(22 * 21 * 6, 5))).individuals.size(), 21u);
  const std::string of_two = NpyOfDoubles({2, 4, 3, 2}, std::vector<double>(48, 5));
  EXPECT_THAT(refused(NpzOf({{"points", of_two}, {"cameras", NpyOfTexts({"left", "right"})}}), "m.npz"),
              HasSubstr("cameras first"));
  for (const std::vector<size_t>& empty : {std::vector<size_t>{1000000000000, 0, 2}, {0, 1000000000000, 2}})
    EXPECT_THAT(refused(NpyOfDoubles(empty, {}), "n.npy"), HasSubstr("holds no joints"));
}

TEST_F(WideCsv, ArraysOfAllCameras) {
  std::vector<double> both = PixelsOf(1, false);
  const std::vector<double> second = PixelsOf(2, false);
  both.insert(both.end(), second.begin(), second.end());
  const auto write = [&](const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return ReadPointArrays(folder_ / name);
  };
  const std::string points = NpyOfDoubles({2, 2, 3, 2}, both);
  const std::vector<TrackedPoints> cameras =
      write("a.npz", NpzOf({{"points", points}, {"cameras", NpyOfTexts({"left", "right"})}}));
  ASSERT_EQ(cameras.size(), 2u);
  EXPECT_EQ(cameras[1].track.camera, "right");
  EXPECT_EQ(cameras[1].track.frames.at(1).at(0).keypoints[2].x_px, 212);
  EXPECT_THAT(testing::MessageOf<FormatError>([&] {
                write("d.npz", NpzOf({{"points", points}, {"cameras", NpyOfTexts({"left", "left"})}}));
              }),
              HasSubstr("names a camera twice: left, left"));
  EXPECT_THAT(testing::MessageOf<FormatError>([&] { write("b.npy", points); }),
              HasSubstr("the names of 0 cameras instead of 2"));
  EXPECT_THAT(testing::MessageOf<FormatError>([&] { write("c.npy", NpyOfDoubles({2, 3, 2}, second)); }), HasSubstr("'pose2d'"));
}

}  // namespace
}  // namespace mvstudio::dataset
