"""What families are put together from: drafts and parameters, shapes, plants, people, things."""
