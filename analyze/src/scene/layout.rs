//! The scene's fixed layout: pictures and map above, neighbours in the middle, curves below; time on `row`.

use rerun::blueprint::components::PanelState;
use rerun::blueprint::{
    BarChartView, Blueprint, BlueprintPanel, ContainerLike, Horizontal, SelectionPanel, Spatial2DView,
    TextDocumentView, TimePanel, TimeSeriesView, Vertical,
};

use super::{Scene, TIMELINE};

pub(super) fn blueprint(scene: &Scene<'_>) -> Blueprint {
    let map: ContainerLike =
        Spatial2DView::new("map: current row, its neighbours, its episode").with_origin("map").into();
    let latent: ContainerLike = BarChartView::new("latent").with_origin("latent").into();
    let about: ContainerLike = TextDocumentView::new("row").with_origin("about").into();
    let pictures = scene.frames.is_some_and(|f| f.recording().manifest().spec.pixels.is_some());
    let mut above: Vec<ContainerLike> = vec![map, latent, about];
    let mut rows: Vec<ContainerLike> = Vec::new();
    let mut shares = vec![3.0];
    if pictures {
        above.insert(0, Spatial2DView::new("frame").with_origin("frame").into());
        let neighbour = |rank: usize| {
            Spatial2DView::new(format!("neighbour {rank}")).with_origin(format!("neighbours/{rank}")).into()
        };
        rows.push(Horizontal::new((1..=scene.neighbours.k()).map(neighbour).collect::<Vec<_>>()).into());
        shares.push(1.6);
    }
    if scene.decoded.is_some() {
        above.insert(1, Spatial2DView::new("what the latent shows").with_origin("decoded/shown").into());
        above.insert(2, Spatial2DView::new("what is predicted").with_origin("decoded/predicted").into());
    }
    rows.push(Horizontal::new(curves(scene)).into());
    shares.push(1.8);
    rows.insert(0, Horizontal::new(above).into());
    Blueprint::new(Vertical::new(rows).with_row_shares(shares))
        .with_auto_layout(false)
        .with_auto_views(false)
        .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Collapsed))
        .with_selection_panel(SelectionPanel::from_state(PanelState::Collapsed))
        .with_time_panel(TimePanel::new().with_state(PanelState::Collapsed).with_timeline(TIMELINE))
}

fn curves(scene: &Scene<'_>) -> Vec<ContainerLike> {
    let mut views: Vec<ContainerLike> = Vec::new();
    if scene.rows.iter().any(|&row| scene.latents.reward[row].is_some()) {
        views.push(TimeSeriesView::new("reward").with_origin("reward").into());
    }
    if let Some(frames) = scene.frames {
        views.push(TimeSeriesView::new("camera").with_origin("distractors/camera").into());
        views.push(TimeSeriesView::new("background").with_origin("distractors/background").into());
        if !frames.recording().manifest().spec.materials.is_empty() {
            views.push(TimeSeriesView::new("colours").with_origin("distractors/colors").into());
        }
    }
    if views.is_empty() {
        views.push(TextDocumentView::new("row").with_origin("about").into());
    }
    views
}
