#include <fstream>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/arrays/pickled_names.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"
#include "tests/trackers/support.h"

/// DeepLabCut's tables. The HDF5 files and their CSV twins were written by pandas 1.5.3 with PyTables 3.7.0.
namespace mvstudio::dataset {
namespace {

using namespace std::string_literals;

class DeepLabCut : public ::testing::Test {
 protected:
  TrackedPoints ReadText(const std::string& text) const {
    std::ofstream(folder_ / "a.csv", std::ios::binary) << text;
    return ReadTrackerFile(folder_ / "a.csv", "left");
  }
  std::string Message(const std::string& text) const {
    return MessageOf<FormatError>([&] { ReadText(text); });
  }
  TempDir folder_;
};

constexpr char kHeader[] =
    "scorer,S,S,S,S,S,S\nbodyparts,nose,nose,nose,tail,tail,tail\ncoords,x,y,likelihood,x,y,likelihood\n";

TEST_F(DeepLabCut, OneAnimal) {
  const TrackedPoints points = ReadText(std::string(kHeader) + "0,1.5,2.5,0.9,3,4,1.0000001\n7,,,,5,6,0\n9,nan,1,1,7,8,0.25\n");
  EXPECT_EQ(points.program, "DeepLabCut");
  EXPECT_THAT(points.joints, ElementsAre("nose", "tail"));
  EXPECT_THAT(points.individuals, ElementsAre(""));
  EXPECT_EQ(points.track.camera, "left");
  const auto& frames = points.track.frames;
  ASSERT_EQ(frames.size(), 3u);
  ASSERT_EQ(frames.at(0).size(), 1u);
  EXPECT_EQ(frames.at(0)[0].keypoints[0].x_px, 1.5);
  EXPECT_EQ(frames.at(0)[0].keypoints[0].score, 0.9);
  EXPECT_EQ(frames.at(0)[0].keypoints[1].score, 1);  // likelihoods are limited to 1
  EXPECT_THAT(frames.at(7), IsEmpty());              // empty cells and likelihood 0: nobody
  EXPECT_EQ(frames.at(9)[0].keypoints[0].score, 0);
  EXPECT_EQ(frames.at(9)[0].keypoints[1].y_px, 8);
}

TEST_F(DeepLabCut, IndividualsBecomePeople) {
  const TrackedPoints points = ReadTrackerFile(Sample("deeplabcut_csv/two.csv"), "a");
  EXPECT_THAT(points.joints, ElementsAre("nose", "tail", "corner"));
  EXPECT_THAT(points.individuals, ElementsAre("m1", "m2", "single"));
  ASSERT_EQ(points.track.frames.at(0).size(), 3u);
  EXPECT_EQ(points.track.frames.at(0)[2].keypoints[0].score, 0);  // `single` has no nose
  EXPECT_GT(points.track.frames.at(0)[2].keypoints[2].score, 0);
  EXPECT_EQ(points.track.frames.at(2).size(), 2u);  // m1 is not there
}

TEST_F(DeepLabCut, TablesOfPandasHoldTheSameAsItsCsv) {
  for (const std::string name : {"one", "two"}) {
    const TrackedPoints csv = ReadTrackerFile(Sample("deeplabcut_csv/" + name + ".csv"), "a");
    EXPECT_EQ(csv.track.frames.size(), 5u);
    for (const std::string format : {"table", "fixed"}) {
      SCOPED_TRACE(name + " " + format);
      ExpectSame(csv, ReadTrackerFile(Sample("tracker_hdf5/dlc_" + name + "_" + format + ".h5"), "a"), 1e-9);
    }
  }
}

TEST_F(DeepLabCut, LabelledImagesAreNumberedByTheirNames) {
  const TrackedPoints one = ReadText("scorer,,,S,S\nbodyparts,,,nose,nose\ncoords,,,x,y\nlabeled-data,v,img0012.png,1,2\n");
  EXPECT_EQ(one.track.frames.at(12)[0].keypoints[0].score, 1);
  const TrackedPoints two = ReadText("scorer,S,S\nbodyparts,nose,nose\ncoords,x,y\nlabeled-data/v/img7.png,1,2\n");
  EXPECT_EQ(two.track.frames.at(7)[0].keypoints[0].y_px, 2);
}

/// Lightning Pose says in a column of texts which images it was trained on.
TEST_F(DeepLabCut, ColumnsThatAreNoCoordinatesNeedNoNumbers) {
  const TrackedPoints read =
      ReadText("scorer,S,S,S,set\nbodyparts,nose,nose,nose,\ncoords,x,y,likelihood,\nlabeled-data/v/img7.png,1,2,0.5,train\n");
  EXPECT_THAT(read.joints, ElementsAre("nose"));
  EXPECT_EQ(read.track.frames.at(7)[0].keypoints[0].score, 0.5);
}

TEST_F(DeepLabCut, DamagedRowsAreListedAndTheRestIsRead) {
  const TrackedPoints points =
      ReadText(std::string(kHeader) + "0,1,2,1,3,4,1\n1,a,2,1,3,4,1\n2,1,2\n3,1,2,1,3,4,1\n4,1,2,1,3,4,1\n4,1,2,1,3,4,1\n");
  EXPECT_EQ(points.track.frames.size(), 3u);
  EXPECT_THAT(points.track.skipped,
              ElementsAre(HasSubstr("line 5: `a` is not a number"), HasSubstr("line 6"), HasSubstr("frame 4 came before")));
}

TEST_F(DeepLabCut, WhatIsNoTableOf2dPointsIsNamed) {
  EXPECT_THAT(Message("scorer,S\nbodyparts,nose\ncoords,x\n0,1\n"), HasSubstr("no column y"));
  EXPECT_THAT(Message("scorer,S,S,S\nbodyparts,a,a,a\ncoords,x,y,z\n0,1,2,3\n"), HasSubstr("3D points"));
  EXPECT_THAT(Message("scorer,S,S,S,S\nbodyparts,a,a,a,a\ncoords,x,y,x,y\n0,1,2,3,4\n"), HasSubstr("one scorer"));
  EXPECT_THAT(Message("scorer,S,S\nbodyparts,a,a\n0,1,2\n"), AllOf(HasSubstr("line 3"), HasSubstr("is no header row")));
  EXPECT_THAT(Message("scorer,S,S\n"), HasSubstr("header rows bodyparts and coords are missing"));
  EXPECT_THAT(Message(std::string(kHeader)), HasSubstr("holds no frame"));
  EXPECT_THAT(Message("scorer;S;S\nbodyparts;a;a\n"), HasSubstr("';'"));
  std::ofstream(folder_ / "a.pickle") << "x";
  EXPECT_THAT(MessageOf<FormatError>([&] { FindTrackerFormat(folder_ / "a.pickle"); }), HasSubstr(".h5 or .csv"));
  EXPECT_THROW(ReadTrackerFile(folder_ / "none.h5", "a"), IoError);
}

TEST_F(DeepLabCut, ManyIndividualsThatShareNoJointAreRefused) {
  std::string scorer = "scorer", individuals = "individuals", joints = "bodyparts", coords = "coords", row;
  for (int i = 0; i < 6000; ++i) {
    const std::string name = std::to_string(i);
    scorer += ",S,S", individuals += ",m" + name + ",m" + name, joints += ",j" + name + ",j" + name, coords += ",x,y";
    row += ",1,2";
  }
  const std::string head = scorer + "\n" + individuals + "\n" + joints + "\n" + coords + "\n";
  EXPECT_THAT(Message(head + "0" + row + "\n"), HasSubstr("share none of their"));
}

TEST_F(DeepLabCut, DamagedHdf5GivesOneLineAndNothingElse) {
  const std::string whole = ReadFile(Sample("tracker_hdf5/dlc_two_fixed.h5"));
  const auto message = [&](const std::string& bytes) {
    std::ofstream(folder_ / "d.h5", std::ios::binary) << bytes;
    return MessageOf<FormatError>([&] { ReadTrackerFile(folder_ / "d.h5", "a"); });
  };
  for (const size_t size : {size_t{9}, whole.size() / 3, whole.size() - 1}) {
    EXPECT_THAT(message(whole.substr(0, size)), AllOf(HasSubstr("d.h5"), HasSubstr("cut off"))) << size;
  }
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadTrackerFile(Sample("tracker_hdf5/project.slp"), "a"); }),
              AllOf(HasSubstr("SLEAP project"), HasSubstr("Export Analysis HDF5")));
}

TEST(PickledNames, EveryProtocolGivesTheSame) {
  using Rows = std::vector<std::vector<std::string>>;
  const Rows names = {{"s", "a", "x"}, {"s", "\xC3\x96", "y"}};
  // pickle.dumps([('s', 'a', 'x'), ('s', 'Ö', 'y')], protocol) of Python 3.11; several protocols store `s` once.
  const std::string first = "(lp0\n(Vs\np1\nVa\np2\nVx\np3\ntp4\na(g1\nV\xD6\np5\nVy\np6\ntp7\na.";
  const std::string second =
      "\x80\x02]q\0(X\1\0\0\0sq\1X\1\0\0\0aq\2X\1\0\0\0xq\3\x87q\4h\1X\2\0\0\0\xC3\x96q\5X\1\0\0\0yq\6\x87q\7e."s;
  const std::string fourth =
      "\x80\4\x95 \0\0\0\0\0\0\0]\x94(\x8c\1s\x94\x8c\1a\x94\x8c\1x\x94\x87\x94h\1\x8c\2\xC3\x96\x94\x8c\1y\x94\x87\x94"
      "e."s;
  EXPECT_EQ(internal::ReadPickledNames(first), names);
  EXPECT_EQ(internal::ReadPickledNames(second), names);
  EXPECT_EQ(internal::ReadPickledNames(fourth), names);
  EXPECT_EQ(internal::ReadPickledNames("(lp0\n(V\\u4e2d\\U0001f400\np1\ntp2\na."), (Rows{{"\xE4\xB8\xAD\xF0\x9F\x90\x80"}}));
}

TEST(PickledNames, ObjectsAndDamageAreRefusedAndNothingRuns) {
  for (const std::string text :
       {"", ".", "cos\nsystem\n(Vecho\ntR.", "(lp0\n(Va\ntp1\na", "(lp0\ng7\na.", "a.", "e.", "t.", "\x87.", "(Va\n.", "Va\n.",
        "(lp0\nVa\na.", "(lp0\n(lp1\n(Va\nta.", "X\xff\xff\xff\xff.", "]q"}) {
    EXPECT_EQ(internal::ReadPickledNames(text), std::nullopt) << text;
  }
}

}  // namespace
}  // namespace mvstudio::dataset
