#include "dataset/session/session_layout.h"

#include "core/error.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

using mvstudio::testing::Put;

/// "TAKE:CAMERA=PATH", in order.
std::vector<std::string> Rows(const ScannedSession& scanned) {
  std::vector<std::string> rows;
  for (const SessionTake& take : scanned.takes) {
    for (const SessionFootage& f : take.footage) rows.push_back(take.name + ":" + f.camera + "=" + f.path);
  }
  return rows;
}

ScannedSession Scan(const std::vector<std::string>& files, SessionLayout layout = SessionLayout::kAuto) {
  const TempDir folder;
  for (const std::string& file : files) Put(folder / ("card/" + file), "x");
  return ScanRaw(folder / "card", layout);
}

TEST(SessionLayout, FoldersOfTakesAsEver) {
  const ScannedSession scanned = Scan({"board/a.mp4", "board/b.mp4", "walk/a.mp4", "walk/b/1.png"});
  EXPECT_THAT(Rows(scanned),
              ElementsAre("board:a=raw/board/a.mp4", "board:b=raw/board/b.mp4", "walk:a=raw/walk/a.mp4", "walk:b=raw/walk/b"));
  EXPECT_TRUE(scanned.notes.empty());
}

/// A folder of frames is a camera, not a take of cameras 0000 and 0001; stills called by their cameras stay what they are.
TEST(SessionLayout, NumberedImagesAreNoCameras) {
  const ScannedSession scanned = Scan({"cam1/0000.png", "cam1/0001.png", "cam2/1.jpg", "cam2/2.jpg", "cam2/3.jpg"});
  EXPECT_TRUE(scanned.takes.empty());
  ASSERT_EQ(scanned.skipped.size(), 2u);
  EXPECT_THAT(scanned.skipped[0], HasSubstr("card/cam1: holds numbered images, which are one camera's frames"));
  EXPECT_THAT(Rows(Scan({"pose/cam_01.png", "pose/cam_02.png"})),
              ElementsAre("pose:cam_01=raw/pose/cam_01.png", "pose:cam_02=raw/pose/cam_02.png"));
  EXPECT_THAT(Rows(Scan({"pose/19110011.png", "pose/19110012.png"})),
              ElementsAre("pose:19110011=raw/pose/19110011.png", "pose:19110012=raw/pose/19110012.png"));
}

TEST(SessionLayout, FoldersOfCamerasByTheirNames) {
  const ScannedSession scanned =
      Scan({"gopro1/board.mp4", "gopro1/walk.mp4", "gopro2/board.mp4", "gopro2/walk/1.png", "gopro2/plate.png"});
  EXPECT_EQ(scanned.layout, SessionLayout::kCameraFirst);
  EXPECT_THAT(Rows(scanned), ElementsAre("board:gopro1=raw/gopro1/board.mp4", "board:gopro2=raw/gopro2/board.mp4",
                                         "walk:gopro1=raw/gopro1/walk.mp4", "walk:gopro2=raw/gopro2/walk"));
  EXPECT_EQ(scanned.takes[0].kind, TakeKind::kBoard);
  EXPECT_EQ(scanned.takes[1].footage[1].plate, "raw/gopro2/plate.png");
  ASSERT_EQ(scanned.notes.size(), 1u);
  EXPECT_THAT(scanned.notes[0], HasSubstr("CAMERA/TAKE: takes board, plate, walk by cameras gopro1, gopro2"));
  EXPECT_THAT(scanned.notes[0], HasSubstr("take-first"));
}

TEST(SessionLayout, SeveralCamerasAreMoreLikelyThanOne) {
  EXPECT_EQ(Scan({"left/rec.mp4", "right/rec.mp4"}).layout, SessionLayout::kCameraFirst);
  EXPECT_EQ(Scan({"board/only.mp4", "walk/only.mp4"}).layout, SessionLayout::kTakeFirst);
}

TEST(SessionLayout, BothReadingsAreSaidWhereNothingTells) {
  const std::vector<std::string> files = {"anna/one.mp4", "anna/two.mp4", "ben/one.mp4", "ben/two.mp4"};
  const ScannedSession open = Scan(files);
  EXPECT_EQ(open.layout, SessionLayout::kTakeFirst);
  ASSERT_EQ(open.notes.size(), 1u);
  EXPECT_THAT(open.notes[0], HasSubstr("TAKE/CAMERA: takes anna, ben by cameras one, two"));
  EXPECT_THAT(open.notes[0], HasSubstr("camera-first reads them as takes one, two by cameras anna, ben"));
  const ScannedSession asked = Scan(files, SessionLayout::kCameraFirst);
  EXPECT_TRUE(asked.notes.empty());
  EXPECT_THAT(Rows(asked), ElementsAre("one:anna=raw/anna/one.mp4", "one:ben=raw/ben/one.mp4", "two:anna=raw/anna/two.mp4",
                                       "two:ben=raw/ben/two.mp4"));
}

TEST(SessionLayout, ChaptersAreOneRecording) {
  const ScannedSession in_takes = Scan({"board/gopro1/GX010123.MP4", "board/gopro1/GX020123.MP4", "board/gopro2/GOPR0007.MP4",
                                        "board/gopro2/GP010007.MP4", "board/gopro3/GX010005.MP4"});
  EXPECT_THAT(Rows(in_takes),
              ElementsAre("board:gopro1=raw/board/gopro1/GX??0123.MP4", "board:gopro2=raw/board/gopro2/G???0007.MP4",
                          "board:gopro3=raw/board/gopro3/GX010005.MP4"));
  const ScannedSession several = Scan({"board/gopro1/GX010123.MP4", "board/gopro1/GX010124.MP4"});
  EXPECT_TRUE(several.takes.empty());
  EXPECT_THAT(several.skipped, ElementsAre(HasSubstr("several recordings"), HasSubstr("holds no footage")));
}

TEST(SessionLayout, MissingChaptersAreNamed) {
  const ScannedSession scanned = Scan({"board/gopro1/GX020001.MP4", "board/gopro2/GX010002.MP4", "board/gopro2/GX030002.MP4"});
  EXPECT_THAT(scanned.missing, ElementsAre("card/board/gopro1/GX010001.MP4", "card/board/gopro2/GX020002.MP4"));
  EXPECT_THAT(Rows(scanned)[0], "board:gopro1=raw/board/gopro1/GX020001.MP4");
  EXPECT_THAT(Scan({"left/GX020009.MP4", "right/GX010009.MP4"}).missing, ElementsAre("card/left/GX010009.MP4"));
  EXPECT_TRUE(Scan({"board/gopro1/GX010001.MP4"}).missing.empty());
}

TEST(SessionLayout, RecordingsThatCamerasNumberArePairedInOrder) {
  const ScannedSession scanned =
      Scan({"left/GX010123.MP4", "left/GX020123.MP4", "left/GX010124.MP4", "right/GX010880.MP4", "right/GX010881.MP4"});
  EXPECT_EQ(scanned.layout, SessionLayout::kCameraFirst);
  EXPECT_THAT(Rows(scanned), ElementsAre("take1:left=raw/left/GX??0123.MP4", "take1:right=raw/right/GX010880.MP4",
                                         "take2:left=raw/left/GX010124.MP4", "take2:right=raw/right/GX010881.MP4"));
  EXPECT_THAT(scanned.notes.back(), HasSubstr("paired in this order, as take1 to take2"));
  EXPECT_THAT(MessageOf<FormatError>([] {
                Scan({"left/GX010123.MP4", "left/GX010124.MP4", "right/GX010880.MP4"});
              }),
              HasSubstr("camera left has 2 recordings and right 1"));
}

TEST(SessionLayout, WordsAndRefusals) {
  SessionLayout layout = SessionLayout::kAuto;
  FromString("camera-first", &layout);
  EXPECT_EQ(ToString(layout), "camera-first");
  EXPECT_THAT(MessageOf<UsageError>([&] { FromString("both", &layout); }),
              HasSubstr("must be one of auto, take-first, camera-first"));
  EXPECT_TRUE(Scan({}).takes.empty());
}

}  // namespace
}  // namespace mvstudio::dataset
